//! The source of a crate as modules: the paths that each module names, and the texts that it makes. Code for tests only is
//! left out.

use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

/// Reads a file of the crate; `None` if there is no such file.
pub(crate) type Load<'a> = &'a dyn Fn(&Path) -> Option<String>;

/// A path that code names, such as `crate::link::Target`, and its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Named {
    /// Its segments; the last one of a glob is `*`.
    pub path: Vec<String>,
    /// The line of its first segment.
    pub line: usize,
    /// The name under which a `use` makes it known here.
    pub known_as: Option<String>,
    /// Whether that `use` also passes the name on (`pub use`).
    pub passed_on: bool,
}

/// A module with its own code, without the code of its submodules.
#[derive(Debug)]
pub(crate) struct Module {
    /// Names from the root of the crate; empty for the root itself.
    pub path: Vec<String>,
    /// The file that contains it.
    pub file: PathBuf,
    /// All paths that it names, and for the root also single words.
    pub named: Vec<Named>,
    /// The text literals of its code. Those that no person reads are left out: attributes except `#[error]`, and what a
    /// programmer reads when an assertion fails.
    pub texts: Vec<Text>,
}

/// A text literal and its line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Text {
    /// Its value.
    pub text: String,
    /// Its line.
    pub line: usize,
}

/// Macros and methods whose texts are for programmers.
const FOR_PROGRAMMERS: [&str; 11] = [
    "expect",
    "expect_err",
    "panic",
    "unreachable",
    "assert",
    "assert_eq",
    "assert_ne",
    "debug_assert",
    "debug_assert_eq",
    "include_str",
    "env",
];

/// All modules of the crate whose root is the file `root`.
///
/// # Errors
/// A file is missing or is not Rust.
pub(crate) fn modules(root: &Path, load: Load<'_>) -> Result<Vec<Module>, String> {
    let mut found = Vec::new();
    let folder = root.parent().unwrap_or(Path::new(""));
    read(
        Module { path: Vec::new(), file: root.to_owned(), named: Vec::new(), texts: Vec::new() },
        folder,
        load,
        &mut found,
    )?;
    Ok(found)
}

/// Reads the module's file and the files of its submodules, which lie in `folder`.
fn read(module: Module, folder: &Path, load: Load<'_>, found: &mut Vec<Module>) -> Result<(), String> {
    let text = load(&module.file).ok_or_else(|| format!("{}: no such file", module.file.display()))?;
    let tokens: TokenStream = text.parse().map_err(|error| format!("{}: {error}", module.file.display()))?;
    walk(module, tokens, folder, load, found)
}

fn walk(
    mut module: Module,
    tokens: TokenStream,
    folder: &Path,
    load: Load<'_>,
    found: &mut Vec<Module>,
) -> Result<(), String> {
    let mut inside = Inside {
        named: Vec::new(),
        texts: Vec::new(),
        files: Vec::new(),
        inline: Vec::new(),
        words: module.path.is_empty(),
        quiet: false,
    };
    inside.tokens(&tokens.into_iter().collect::<Vec<_>>());
    (module.named, module.texts) = (inside.named, inside.texts);
    let child = |name: &str| [module.path.clone(), vec![name.to_owned()]].concat();
    for name in inside.files {
        let path = child(&name);
        let beside = folder.join(format!("{name}.rs"));
        let file = if load(&beside).is_some() { beside } else { folder.join(&name).join("mod.rs") };
        read(Module { path, file, named: Vec::new(), texts: Vec::new() }, &folder.join(&name), load, found)?;
    }
    for (name, body) in inside.inline {
        let inner = Module { path: child(&name), file: module.file.clone(), named: Vec::new(), texts: Vec::new() };
        walk(inner, body, &folder.join(&name), load, found)?;
    }
    found.push(module);
    Ok(())
}

/// The findings in the code of one module.
struct Inside {
    named: Vec<Named>,
    texts: Vec<Text>,
    /// Submodules in separate files.
    files: Vec<String>,
    /// Submodules in the same file.
    inline: Vec<(String, TokenStream)>,
    /// Whether single words count too.
    words: bool,
    /// Whether the texts here are for programmers.
    quiet: bool,
}

impl Inside {
    fn tokens(&mut self, tokens: &[TokenTree]) {
        let mut at = 0;
        while at < tokens.len() {
            at += self.next(tokens, at).max(1);
        }
    }

    /// Processes the code at `at`; returns its number of tokens.
    fn next(&mut self, tokens: &[TokenTree], at: usize) -> usize {
        let rest = &tokens[at..];
        match rest {
            [TokenTree::Punct(hash), TokenTree::Punct(inner), TokenTree::Group(attribute), ..]
                if (hash.as_char(), inner.as_char()) == ('#', '!') =>
            {
                self.quietly(true, |inside| inside.group(attribute)) + 2
            }
            [TokenTree::Punct(hash), TokenTree::Group(attribute), item @ ..] if hash.as_char() == '#' => {
                if is_for_tests(attribute) {
                    return 2 + item_length(item);
                }
                let is_error = attribute.stream().into_iter().next().is_some_and(|word| word.to_string() == "error");
                self.quietly(!is_error, |inside| inside.group(attribute)) + 1
            }
            [TokenTree::Ident(word), TokenTree::Ident(name), TokenTree::Punct(_), ..] if word == "mod" => {
                self.files.push(name.to_string());
                3
            }
            [TokenTree::Ident(word), TokenTree::Ident(name), TokenTree::Group(body), ..] if word == "mod" => {
                self.inline.push((name.to_string(), body.stream()));
                3
            }
            [TokenTree::Ident(word), ..] if word == "use" && !is_in_path(tokens, at) => {
                let end = rest.iter().position(|token| is_punct(token, ';')).unwrap_or(rest.len());
                let passed_on = at > 0 && matches!(&tokens[at - 1], TokenTree::Ident(before) if before == "pub")
                    || at > 1 && matches!(&tokens[at - 2], TokenTree::Ident(before) if before == "pub");
                self.tree(&rest[1..end], &[], passed_on);
                end + 1
            }
            // The scope of a visibility is not a use: `pub(in crate::compute)`.
            [TokenTree::Ident(word), TokenTree::Group(scope), ..]
                if word == "pub" && scope.delimiter() == Delimiter::Parenthesis =>
            {
                2
            }
            [TokenTree::Ident(first), ..] if !is_in_path(tokens, at) => {
                let mut path = vec![first.to_string()];
                let mut length = 1;
                while let [TokenTree::Punct(a), TokenTree::Punct(b), TokenTree::Ident(segment), ..] = &rest[length..]
                    && (a.as_char(), b.as_char()) == (':', ':')
                {
                    path.push(segment.to_string());
                    length += 3;
                }
                if path.len() > 1 || self.words {
                    let line = first.span().start().line;
                    self.named.push(Named { path, line, known_as: None, passed_on: false });
                }
                length
            }
            [TokenTree::Group(group), ..] => {
                let before = tokens[..at].iter().rev().find(|token| !is_punct(token, '!'));
                let quiet =
                    matches!(before, Some(TokenTree::Ident(word)) if FOR_PROGRAMMERS.iter().any(|one| word == one));
                self.quietly(quiet, |inside| inside.group(group))
            }
            [TokenTree::Literal(literal), ..] => {
                if !self.quiet
                    && let Ok(text) = syn::parse_str::<syn::LitStr>(&literal.to_string())
                {
                    self.texts.push(Text { text: text.value(), line: literal.span().start().line });
                }
                1
            }
            _ => 1,
        }
    }

    /// Walks with texts left out, if they are for programmers.
    fn quietly(&mut self, quiet: bool, walk: impl FnOnce(&mut Self) -> usize) -> usize {
        let before = self.quiet;
        self.quiet |= quiet;
        let length = walk(self);
        self.quiet = before;
        length
    }

    fn group(&mut self, group: &Group) -> usize {
        self.tokens(&group.stream().into_iter().collect::<Vec<_>>());
        1
    }

    /// One tree of a `use`: `a::{b, c::d as e, f::*}`.
    fn tree(&mut self, tokens: &[TokenTree], before: &[String], passed_on: bool) {
        let mut path = before.to_vec();
        let mut known_as = None;
        let line = tokens.first().map_or(0, |token| token.span().start().line);
        let mut rest = tokens;
        while let [token, tail @ ..] = rest {
            match token {
                TokenTree::Ident(word) if word == "as" => {
                    known_as = tail.first().map(ToString::to_string);
                    break;
                }
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Punct(mark) if mark.as_char() == '*' => path.push("*".to_owned()),
                TokenTree::Group(group) => {
                    let inner: Vec<_> = group.stream().into_iter().collect();
                    for branch in inner.split(|token| is_punct(token, ',')).filter(|branch| !branch.is_empty()) {
                        self.tree(branch, &path, passed_on);
                    }
                    return;
                }
                TokenTree::Punct(_) | TokenTree::Literal(_) => {}
            }
            rest = tail;
        }
        // `a::{self}` means `a`; `self::a` keeps its head, which says where the path begins.
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let known_as = known_as.or_else(|| path.last().cloned());
        self.named.push(Named { path, line, known_as, passed_on });
    }
}

fn is_punct(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

/// Whether the token at `at` continues a path: `::` before it, and before that a token to which the `::` belongs.
fn is_in_path(tokens: &[TokenTree], at: usize) -> bool {
    at >= 3
        && is_punct(&tokens[at - 1], ':')
        && is_punct(&tokens[at - 2], ':')
        && (matches!(tokens[at - 3], TokenTree::Ident(_)) || is_punct(&tokens[at - 3], '>'))
}

/// `[cfg(test)]`, and `[cfg(any(test, ...))]`.
fn is_for_tests(attribute: &Group) -> bool {
    let tokens: Vec<_> = attribute.stream().into_iter().collect();
    match tokens.as_slice() {
        [TokenTree::Ident(word), TokenTree::Group(condition)] if word == "cfg" => {
            let condition = condition.stream().to_string();
            condition.split(|mark: char| !mark.is_alphanumeric()).any(|word| word == "test")
                && !condition.contains("not")
        }
        _ => false,
    }
}

/// Number of tokens of the item, up to its `;` or its braces. A field or an arm is not an item and is not skipped.
fn item_length(tokens: &[TokenTree]) -> usize {
    const ITEMS: [&str; 16] = [
        "pub",
        "mod",
        "use",
        "fn",
        "impl",
        "const",
        "static",
        "struct",
        "enum",
        "type",
        "trait",
        "async",
        "unsafe",
        "extern",
        "union",
        "macro_rules",
    ];
    let mut at = 0;
    while let [hash, TokenTree::Group(_), ..] = &tokens[at..]
        && is_punct(hash, '#')
    {
        at += 2;
    }
    if !matches!(tokens.get(at), Some(TokenTree::Ident(word)) if ITEMS.iter().any(|item| word == item)) {
        return 0;
    }
    let ends = |token: &TokenTree| {
        is_punct(token, ';') || matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace)
    };
    let end = tokens[at..].iter().position(ends);
    end.map_or(tokens.len(), |end| at + end + 1)
}

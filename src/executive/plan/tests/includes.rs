//! Plans of several files.

use super::*;

#[test]
fn includes_come_first_and_are_part_of_the_digest() {
    let root = "name = \"root\"\nversion = \"1\"\ninclude = [\"../common/a.toml\", \"b.toml\"]\n[[item]]\nid = \"io\"\nrequires = [\"identity\"]\n[item.limits]\nwrong_reads = \"== 0\"\n";
    let a = format!("name = \"a\"\nversion = \"1\"\ninclude = [\"./c.toml\"]\n{IDENTITY}");
    let b = "name = \"b\"\nversion = \"1\"\n[[item]]\nid = \"spi\"\nphase = \"setup\"\n";
    let c = "name = \"c\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\n[item.limits]\n\"*\" = \"== 0\"\n";
    let plan = read(&[
        ("plans/line/root.toml", root),
        ("plans/common/a.toml", &a),
        ("plans/line/b.toml", b),
        ("plans/common/c.toml", c),
    ])
    .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(plan.name, "root");
    let names: Vec<&str> = plan.items().iter().map(|item| item.name.as_str()).collect();
    // Setup runs before tests, wherever it stands.
    assert_eq!(names, ["spi", "cpu", "identity", "io"]);
    assert_eq!(plan.items()[3].requires, [2]);
    let files: Vec<(&str, &[u8])> = plan.files().collect();
    assert_eq!(files[0], ("plans/line/root.toml", root.as_bytes()));
    let order: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    assert_eq!(order, ["plans/line/root.toml", "plans/common/a.toml", "plans/common/c.toml", "plans/line/b.toml"]);
}

#[test]
fn includes_that_are_refused() {
    let plan = |include: &str| format!("name = \"p\"\nversion = \"1\"\ninclude = [{include}]\n{IDENTITY}");
    let mut out = String::new();
    for files in [
        vec![("a.toml", plan("\"b.toml\"")), ("b.toml", plan("\"a.toml\""))],
        vec![("a.toml", plan("\"a.toml\""))],
        vec![("a.toml", plan("\"missing.toml\", \"/etc/passwd\", \"\", \"x\\u001b.toml\""))],
        vec![("dir/a.toml", plan("\"b.toml\", \"./b.toml\"")), ("dir/b.toml", plan(""))],
        vec![("a.toml", plan("\"b.toml\"")), ("b.toml", "name = ".to_owned())],
        vec![("a.toml", plan("5")), ("b.toml", String::new())],
    ] {
        let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        out.push_str(&read(&files).unwrap_err().to_string());
        out.push_str("\n\n");
    }
    insta::assert_snapshot!(out, @r#"
    b.toml:3:12: the includes form a circle: "a.toml" > "b.toml" > "a.toml"
     3 | include = ["a.toml"]
       |            ^^^^^^^^
       = try: remove one of them

    a.toml:5:6: the name "identity" appears twice, first at b.toml:5
     5 | id = "identity"
       |      ^^^^^^^^^^
       = try: give one of them a name of its own: name = "..."

    a.toml:3:12: the includes form a circle: "a.toml" > "a.toml"
     3 | include = ["a.toml"]
       |            ^^^^^^^^
       = try: remove one of them

    a.toml:3:12: "missing.toml" cannot be read: no such file
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |            ^^^^^^^^^^^^^^
       = try: the path is relative to the file that includes it

    a.toml:3:28: "/etc/passwd" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                            ^^^^^^^^^^^^^
       = try: write it relative to this file, with / between folders

    a.toml:3:43: "" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                                           ^^
       = try: write it relative to this file, with / between folders

    a.toml:3:47: "x\u{1b}.toml" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                                               ^^^^^^^^^^^^^^
       = try: write it relative to this file, with / between folders

    dir/a.toml:3:22: "dir/b.toml" is included twice
     3 | include = ["b.toml", "./b.toml"]
       |                      ^^^^^^^^^^
       = try: remove one of them

    dir/a.toml:5:6: the name "identity" appears twice, first at dir/b.toml:5
     5 | id = "identity"
       |      ^^^^^^^^^^
       = try: give one of them a name of its own: name = "..."

    b.toml:1:8: this is not a text in quotes, a number, true or false
     1 | name = 
       |        ^
       = try: write texts in quotes: name = "functional"

    a.toml:3:12: "include" is a whole number, and must be a list of texts in quotes
     3 | include = [5]
       |            ^
    "#);
}

#[test]
fn includes_are_bounded() {
    // The first plan is a chain of includes without end. The second one has more includes than allowed.
    let mut asked = 0;
    let mut chain = |name: &str| {
        asked += 1;
        let next = name.trim_end_matches(".toml").parse::<u32>().unwrap_or(0) + 1;
        Ok::<_, String>(format!("name = \"p\"\nversion = \"1\"\ninclude = [\"{next}.toml\"]").into_bytes())
    };
    let root = chain("0.toml").unwrap();
    let text = Plan::read("0.toml", root, &mut chain).unwrap_err().to_string();
    assert!(text.contains("includes are nested more than 8 deep"), "{text}");
    assert!(asked <= 10);
    let names: Vec<String> = (0..1000).map(|index| format!("\"{index}.toml\"")).collect();
    let root = format!("name = \"p\"\nversion = \"1\"\ninclude = [{}]", names.join(", "));
    let mut asked = 0;
    let mistakes = Plan::read("root.toml", root.into_bytes(), &mut |_| {
        asked += 1;
        Ok::<_, String>(b"name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nphase = \"setup\"\n".to_vec())
    })
    .unwrap_err();
    assert_eq!(asked, 31);
    assert!(mistakes.to_string().contains("the plan has more than 32 files"), "{mistakes}");
    assert_eq!(mistakes.iter().count(), gnc_config::MAX_MISTAKES);
    assert!(mistakes.to_string().ends_with(&format!("and {} more", mistakes.count() - 50)), "{mistakes}");
}

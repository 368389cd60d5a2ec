//! Why a file could not be read as a table.

use std::io;
use std::path::PathBuf;

use gnc_metrology::Refusal;
use thiserror::Error;

use super::LONGEST_LINE;

/// Why a file could not be read as a table.
#[derive(Debug, Error)]
pub(in crate::compute) enum TableError {
    #[error("{path}: cannot be read")]
    Io { path: PathBuf, source: io::Error },
    #[error("{path}: is {what}, not a table")]
    Foreign { path: PathBuf, what: &'static str, hint: &'static str },
    #[error("{path}: {what}")]
    Damaged { path: PathBuf, what: String },
    #[error("{path}:{line}:1: no header row with column names")]
    NoHeader { path: PathBuf, line: usize },
    #[error("{path}:{line}:1: no column `{name}`; the header has {header}")]
    NoColumn { path: PathBuf, line: usize, name: String, header: String },
    #[error("{path}:{line}:1: column `{name}` is ambiguous: it may be {columns}")]
    Unclear { path: PathBuf, line: usize, name: String, columns: String },
    #[error("{path}:{line}:{column}: column `{name}` appears twice in the header")]
    Doubled { path: PathBuf, line: usize, column: usize, name: String },
    #[error("{path}:{line}:{column}: row has {got} fields, the header has {expected}")]
    Fields { path: PathBuf, line: usize, column: usize, got: usize, expected: usize },
    #[error("{path}:{line}:{column}: `{text}` in column `{name}` is not a number")]
    Number { path: PathBuf, line: usize, column: usize, name: String, text: String },
    #[error(
        "{path}:{line}:{column}: `{text}` in column `{name}` may have a decimal comma or a thousands separator; the file does not show which"
    )]
    Ambiguous { path: PathBuf, line: usize, column: usize, name: String, text: String },
    #[error(
        "{path}: `{comma}` in line {comma_line} has a decimal comma, `{point}` in line {point_line} a decimal point"
    )]
    MixedDecimals { path: PathBuf, comma_line: usize, comma: String, point_line: usize, point: String },
    #[error("{path}:{line}:{column}: a quote is not closed in this line")]
    OpenQuote { path: PathBuf, line: usize, column: usize },
    #[error("{path}:{line}:{column}: `{text}` in column `{name}` is not one of {allowed}")]
    Label { path: PathBuf, line: usize, column: usize, name: String, text: String, allowed: String },
    #[error("{path}:{line}:1: line is longer than {LONGEST_LINE} bytes")]
    LongLine { path: PathBuf, line: usize },
    #[error("{path}: no line end within {LONGEST_LINE} bytes; is it a text?")]
    Endless { path: PathBuf },
    #[error("{path}: more than {limit} values in the columns that the method uses")]
    TooLarge { path: PathBuf, limit: usize },
    #[error("{path}: no rows after the header")]
    NoRows { path: PathBuf },
    #[error("{path}: no rows of capture `{capture}`; it holds {captures}")]
    NoCapture { path: PathBuf, capture: String, captures: String },
    #[error("{path}: it holds {count} captures; add the name of one to the path: {captures}")]
    ManyCaptures { path: PathBuf, count: usize, captures: String },
    #[error("the sample rate is not known: {why}")]
    NoRate { why: String },
    #[error("{what}")]
    Units { what: String },
    #[error(transparent)]
    Refused(#[from] Refusal),
}

impl TableError {
    /// What the user can try.
    pub(in crate::compute) fn try_this(&self) -> Option<&'static str> {
        match self {
            Self::Io { source, .. } if source.kind() == io::ErrorKind::NotFound => {
                Some("check the path; it starts at the current folder")
            }
            Self::Io { source, .. } if source.kind() == io::ErrorKind::PermissionDenied => {
                Some("ask for the right to read it, or copy it to a folder of your own")
            }
            Self::Io { source, .. } if source.kind() == io::ErrorKind::IsADirectory => {
                Some("name a file in this folder")
            }
            Self::Io { source, .. } if gnc_files::is_refused(source).is_some() => {
                Some("name a file, or pipe the data to standard input and name it -")
            }
            Self::Io { .. } | Self::Damaged { .. } => {
                Some("the file may be cut off or damaged: copy or export it again")
            }
            Self::Foreign { hint, .. } => Some(hint),
            Self::Ambiguous { .. } | Self::MixedDecimals { .. } => Some("give --decimal comma or --decimal point"),
            Self::Unclear { .. } => Some("rename or remove all but one of these columns"),
            Self::TooLarge { .. } => Some("cut the record into parts, or lower its rate"),
            Self::NoColumn { header, .. } if header.contains(' ') && !header.contains(", ") => Some(
                "the rows have one field each; if commas separate several numbers in a field, give --decimal point",
            ),
            Self::NoColumn { .. } => Some(
                "write this name in the header; `gnc-station compute METHOD --help` lists the columns of the method and the \
                 options that choose others",
            ),
            Self::NoHeader { .. } => Some("write a line with the column names above the rows"),
            Self::NoRows { .. } => Some("record again, or name the file that has the rows"),
            Self::Doubled { .. } => Some("rename or remove one of the two, and check that the file is a table"),
            Self::NoRate { .. } => Some("give the rate with --rate HZ"),
            Self::Units { .. } => Some("correct the unit in the header, or leave out the option that contradicts it"),
            Self::Fields { .. } => Some(
                "each row needs as many fields as the header; a number with a comma in it needs quotes, or `;` between fields",
            ),
            _ => None,
        }
    }
}

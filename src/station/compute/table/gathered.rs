//! Rows as they were read: values by columns, and where captures begin.

use std::collections::HashSet;
use std::ops::Range;

/// Values read so far from a file or from a piece of it.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    pub(super) numbers: Vec<Vec<f64>>,
    pub(super) labels: Vec<u8>,
    pub(super) times: Vec<f64>,
    /// Cells without a value: the index of the column of numbers, and the line.
    pub(super) missing: Vec<(usize, usize)>,
    /// First rows of captures and their names.
    pub(super) captures: Vec<(usize, String)>,
    /// Names of captures that were skipped.
    pub(super) others: Vec<String>,
    /// The same names, to find one among many.
    pub(super) passed_over: HashSet<Vec<u8>>,
    pub(super) rows: usize,
}

/// What the place of a cell without a value takes, in values.
const OF_MISSING: usize = 2;
/// What the beginning of a capture takes with its name, in values.
const OF_CAPTURE: usize = 8;

impl Gathered {
    /// The memory that rows of so many columns take so far, in values. A row may begin a capture, or lack all of its values.
    pub(super) fn values(&self, columns: usize) -> usize {
        let of_missing = self.missing.len().saturating_mul(OF_MISSING);
        let of_captures = (self.captures.len() + self.others.len()).saturating_mul(OF_CAPTURE);
        self.rows.saturating_mul(columns).saturating_add(of_missing).saturating_add(of_captures)
    }

    /// Blocks of rows with one label, one capture, and one value of the column that starts time anew.
    pub(super) fn blocks(&self, anew: Option<usize>) -> Vec<Range<usize>> {
        let changes = (1..self.labels.len()).filter(|&i| self.labels[i] != self.labels[i - 1]);
        let column = anew.and_then(|k| self.numbers.get(k)).map_or(&[][..], Vec::as_slice);
        let begins = (1..column.len().min(self.rows)).filter(|&i| column[i] != column[i - 1]);
        let mut starts: Vec<usize> =
            changes.chain(begins).chain(self.captures.iter().map(|(row, _)| *row)).chain([0]).collect();
        starts.sort_unstable();
        starts.dedup();
        let ends = starts.iter().skip(1).copied().chain([self.rows]);
        starts.iter().zip(ends).map(|(start, end)| *start..end).filter(|block| !block.is_empty()).collect()
    }

    /// Notes where a capture begins. Each row has the name of its capture.
    pub(super) fn begin(&mut self, row: usize, name: &[u8]) {
        if self.captures.last().is_none_or(|(_, before)| before.as_bytes() != name) {
            self.captures.push((row, String::from_utf8_lossy(name).into_owned()));
        }
    }

    /// Notes a capture that was skipped.
    pub(super) fn pass_over(&mut self, name: &[u8]) {
        if !self.passed_over.contains(name) {
            self.passed_over.insert(name.to_owned());
            self.others.push(String::from_utf8_lossy(name).into_owned());
        }
    }

    /// Adds the rows of the next piece, which has `lines` lines before it.
    pub(super) fn add(&mut self, piece: &Self, lines: usize) {
        for (column, part) in self.numbers.iter_mut().zip(&piece.numbers) {
            column.extend_from_slice(part);
        }
        self.labels.extend_from_slice(&piece.labels);
        self.times.extend_from_slice(&piece.times);
        self.missing.extend(piece.missing.iter().map(|(column, line)| (*column, lines + line)));
        let before = self.rows;
        piece.captures.iter().for_each(|(row, name)| self.begin(before + row, name.as_bytes()));
        piece.others.iter().for_each(|name| self.pass_over(name.as_bytes()));
        self.rows += piece.rows;
    }
}

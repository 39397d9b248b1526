//! Lines and numbers of text formats, with line numbers for errors.

use crate::error::{EngineError, Reason};
use crate::vector::Vec3;

/// Walks over the lines of a file. Lines end with LF, CR LF or a lone CR; ends are not part of a line.
#[derive(Debug, Clone)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
    length: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Lines { rest: bytes, number: 0, length: bytes.len() }
    }

    /// The next line, `None` at the end of the file.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        let skip = match self.rest.get(end) {
            Some(b'\r') if self.rest.get(end + 1) == Some(&b'\n') => 2,
            Some(_) => 1,
            None => 0,
        };
        self.rest = &self.rest[end + skip..];
        Some(line)
    }

    /// The next line that is neither blank nor begins with `comment` (if given).
    #[inline]
    pub(crate) fn next_content(&mut self, comment: Option<u8>) -> Option<&'a [u8]> {
        loop {
            let line = self.next()?.trim_ascii_start();
            if !line.is_empty() && (comment.is_none() || Some(line[0]) != comment) {
                return Some(line);
            }
        }
    }

    /// Number of the line last returned, from 1.
    pub(crate) fn number(&self) -> usize {
        self.number
    }

    /// What has not been read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Byte offset of [`Lines::rest`] in the file.
    pub(crate) fn offset(&self) -> usize {
        self.length - self.rest.len()
    }

    /// Goes on after `count` bytes of the rest (a binary section), which count as no line.
    pub(crate) fn skip_bytes(&mut self, count: usize) {
        self.rest = &self.rest[count.min(self.rest.len())..];
    }

    /// An error at the line last returned.
    pub(crate) fn malformed(&self, message: impl std::fmt::Display) -> EngineError {
        malformed_at_line(self.number, message)
    }

    /// The error for a file that ends too early.
    pub(crate) fn ends_early(&self, wanted: &str) -> EngineError {
        malformed_at_line(self.number, format!("the file ends where {wanted} should follow"))
    }
}

/// An error at a line of a text file.
pub(crate) fn malformed_at_line(line: usize, message: impl std::fmt::Display) -> EngineError {
    EngineError::new(Reason::FormatMalformed, format!("line {line}: {message}")).with_metadata("line", line)
}

/// Words of a line, separated by white space.
#[derive(Debug, Clone)]
pub(crate) struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    pub(crate) fn new(line: &'a [u8]) -> Self {
        Words(line)
    }

    /// What has not been read yet, without white space at its ends.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.0.trim_ascii()
    }

    /// The next word as a number of any kind that reads text.
    #[inline]
    pub(crate) fn parse<T: std::str::FromStr>(&mut self) -> Option<T> {
        std::str::from_utf8(self.next()?).ok()?.parse().ok()
    }

    /// The next word as a real number; "nan" and "inf" are numbers here, and refused later with their vertex.
    #[inline]
    pub(crate) fn real(&mut self) -> Option<f64> {
        fast_float2::parse(self.next()?).ok()
    }

    /// The next three words as a point.
    #[inline]
    pub(crate) fn point(&mut self) -> Option<Vec3> {
        Some([self.real()?, self.real()?, self.real()?])
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.0.iter().position(|b| !b.is_ascii_whitespace())?;
        let word = &self.0[start..];
        let end = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        self.0 = &word[end..];
        Some(&word[..end])
    }
}

/// Text of a name in a file: UTF-8, with anything else replaced; white space at its ends is dropped.
pub(crate) fn name_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.trim_ascii()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_line_end() {
        let mut lines = Lines::new(b"a\nb\r\nc\rd\r\r\ne");
        let mut seen = Vec::new();
        while let Some(line) = lines.next() {
            seen.push(String::from_utf8_lossy(line).into_owned());
        }
        assert_eq!(seen, ["a", "b", "c", "d", "", "e"]);
        assert_eq!(lines.number(), 6);
    }

    #[test]
    fn words_and_numbers() {
        let mut words = Words::new(b"  v\t1e-3 +2.5  nan -7 rest of it ");
        assert_eq!(words.next(), Some(&b"v"[..]));
        let p = words.point().unwrap();
        assert!(p[0] == 1e-3 && p[1] == 2.5 && p[2].is_nan());
        assert_eq!(words.parse::<i64>(), Some(-7));
        assert_eq!(words.rest(), b"rest of it");
    }
}

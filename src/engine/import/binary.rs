//! Numbers of binary formats in either byte order, never past the end of the file.

use crate::error::{EngineError, Reason, Result};

/// Byte order of a binary file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// Reads numbers one after the other.
#[derive(Debug, Clone)]
pub(crate) struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
    base: usize,
    pub(crate) order: ByteOrder,
}

macro_rules! number {
    ($name:ident, $type:ty) => {
        #[inline]
        pub(crate) fn $name(&mut self) -> Result<$type> {
            let raw = self.array()?;
            Ok(match self.order {
                ByteOrder::Little => <$type>::from_le_bytes(raw),
                ByteOrder::Big => <$type>::from_be_bytes(raw),
            })
        }
    };
}

impl<'a> ByteReader<'a> {
    /// A reader of `bytes`, which begin at offset `base` of the file.
    pub(crate) fn new(bytes: &'a [u8], base: usize, order: ByteOrder) -> Self {
        ByteReader { bytes, at: 0, base, order }
    }

    #[inline]
    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let raw = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>()).copied();
        self.at += N;
        raw.ok_or_else(|| self.ends_early())
    }

    #[cold]
    fn ends_early(&self) -> EngineError {
        self.malformed("the file ends in the middle of its data")
    }

    /// An error at the present offset.
    pub(crate) fn malformed(&self, message: impl std::fmt::Display) -> EngineError {
        let offset = self.base + self.at.min(self.bytes.len());
        EngineError::new(Reason::FormatMalformed, format!("byte {offset}: {message}")).with_metadata("byte", offset)
    }

    number!(u8, u8);
    number!(i8, i8);
    number!(u16, u16);
    number!(i16, i16);
    number!(u32, u32);
    number!(i32, i32);
    number!(u64, u64);
    number!(f32, f32);
    number!(f64, f64);

    /// Passes over `count` bytes.
    pub(crate) fn skip(&mut self, count: usize) -> Result<()> {
        if count > self.remaining() {
            return Err(self.ends_early());
        }
        self.at += count;
        Ok(())
    }

    /// Bytes read so far.
    pub(crate) fn position(&self) -> usize {
        self.at.min(self.bytes.len())
    }

    /// Bytes left.
    pub(crate) fn remaining(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// Refuses a count of records that cannot fit into what is left, each of at least `least` bytes.
    pub(crate) fn fits(&self, count: u64, least: usize, what: &str) -> Result<usize> {
        match usize::try_from(count) {
            Ok(n) if n.checked_mul(least.max(1)).is_some_and(|b| b <= self.remaining()) => Ok(n),
            _ => Err(self.malformed(format!("{count} {what} are announced, but only {} bytes follow", self.remaining()))),
        }
    }
}

//! 128-bit fingerprints of contents: the keys of the stage cache.

use std::fmt;

/// First 128 bits of a BLAKE3 hash of some contents in a canonical encoding.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Fingerprint(pub [u8; 16]);

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Data that has a fingerprint and a size in memory: everything that is an input or output of a stage.
pub trait Contents {
    /// Feeds every bit that matters to the hasher, with lengths before arrays.
    fn feed(&self, into: &mut Feeder);

    /// Bytes held on the heap and inline, for the budget of the cache. Need not be exact to the byte.
    fn bytes(&self) -> usize;

    /// Fingerprint of the fed contents.
    fn fingerprint(&self) -> Fingerprint {
        let mut feeder = Feeder::new();
        self.feed(&mut feeder);
        feeder.finish()
    }
}

/// Builds a fingerprint from typed values; every array is preceded by its length.
#[derive(Debug, Default)]
pub struct Feeder {
    hasher: blake3::Hasher,
    buffer: Vec<u8>,
}

const FLUSH_AT: usize = 64 * 1024;

impl Feeder {
    /// An empty feeder.
    pub fn new() -> Self {
        Self::default()
    }

    fn flush(&mut self) {
        self.hasher.update(&self.buffer);
        self.buffer.clear();
    }

    fn room(&mut self) {
        if self.buffer.len() >= FLUSH_AT {
            self.flush();
        }
    }

    /// Raw bytes, preceded by their count.
    pub fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.u64(bytes.len() as u64);
        self.flush();
        self.hasher.update(bytes);
        self
    }

    /// A text.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.raw(text.as_bytes())
    }

    /// One integer.
    pub fn u64(&mut self, value: u64) -> &mut Self {
        self.buffer.extend_from_slice(&value.to_le_bytes());
        self.room();
        self
    }

    /// One number, by its bits.
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.u64(value.to_bits())
    }

    /// One optional number.
    pub fn option_f64(&mut self, value: Option<f64>) -> &mut Self {
        match value {
            None => self.u64(0),
            Some(value) => self.u64(1).f64(value),
        }
    }

    /// Another fingerprint.
    pub fn fingerprint(&mut self, value: Fingerprint) -> &mut Self {
        self.buffer.extend_from_slice(&value.0);
        self.room();
        self
    }

    /// An array of numbers.
    pub fn f64s(&mut self, values: &[f64]) -> &mut Self {
        self.u64(values.len() as u64);
        for value in values {
            self.f64(*value);
        }
        self
    }

    /// An array of indices.
    pub fn u32s(&mut self, values: &[u32]) -> &mut Self {
        self.u64(values.len() as u64);
        for value in values {
            self.buffer.extend_from_slice(&value.to_le_bytes());
            self.room();
        }
        self
    }

    /// An array of points or of index tuples, flattened.
    pub fn points<const N: usize>(&mut self, values: &[[f64; N]]) -> &mut Self {
        self.f64s(values.as_flattened())
    }

    /// An array of index tuples.
    pub fn tuples<const N: usize>(&mut self, values: &[[u32; N]]) -> &mut Self {
        self.u32s(values.as_flattened())
    }

    /// The fingerprint of all that was fed.
    pub fn finish(mut self) -> Fingerprint {
        self.flush();
        let mut first = [0; 16];
        first.copy_from_slice(&self.hasher.finalize().as_bytes()[..16]);
        Fingerprint(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn array_boundaries_matter() {
        let of = |a: &[u32], b: &[u32]| {
            let mut feeder = Feeder::new();
            feeder.u32s(a).u32s(b);
            feeder.finish()
        };
        assert_eq!(of(&[1, 2], &[3]), of(&[1, 2], &[3]));
        assert_ne!(of(&[1, 2], &[3]), of(&[1], &[2, 3]));
    }

    #[test]
    fn chunking_does_not_matter() {
        let long: Vec<f64> = (0..30_000).map(f64::from).collect();
        let mut feeder = Feeder::new();
        feeder.f64s(&long);
        let mut by_hand = blake3::Hasher::new();
        by_hand.update(&(long.len() as u64).to_le_bytes());
        for value in &long {
            by_hand.update(&value.to_bits().to_le_bytes());
        }
        assert_eq!(feeder.finish().0, by_hand.finalize().as_bytes()[..16]);
    }
}

//! Random numbers from a seed, and random damage to bytes and text.

/// SplitMix64.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `bound`; 0 for an empty range.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }

    pub(crate) fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    pub(crate) fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }
}

const WORDS: [&str; 22] = [
    "nan",
    "-inf",
    "1e999",
    "-1",
    "0",
    "4294967296",
    "18446744073709551616",
    "1e-320",
    "facet",
    "v",
    "f 1 1 1",
    "element face 99999999",
    "$Elements",
    "{}",
    "[",
    "\"",
    "999999999",
    "property list uchar int x",
    "-2147483649",
    "#",
    "\u{fffd}",
    "1 2",
];

/// One to eight random wounds.
pub(crate) fn damaged(mut bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    for _ in 0..1 + random.below(8) {
        if bytes.is_empty() {
            return bytes;
        }
        let at = random.below(bytes.len());
        match random.below(8) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at),
            3 => {
                let end = (at + 1 + random.below(64)).min(bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let end = (at + 1 + random.below(64)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            5 => {
                // A word of a text becomes another one.
                let space = |b: &u8| b.is_ascii_whitespace();
                let begin = bytes[..at].iter().rposition(space).map_or(0, |i| i + 1);
                let end = bytes[at..].iter().position(space).map_or(bytes.len(), |i| at + i);
                bytes.splice(begin..end.max(begin), random.pick(&WORDS).bytes());
            }
            6 => {
                let value = *random.pick(&[0u32, 1, u32::MAX, 0x7fff_ffff, 0x7fc0_0000, 1 << 20]);
                for (k, b) in value.to_le_bytes().into_iter().enumerate().filter(|(k, _)| at + k < bytes.len()).collect::<Vec<_>>() {
                    bytes[at + k] = b;
                }
            }
            _ => {
                let line = bytes[at..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| at + i + 1);
                let next = bytes[line..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| line + i + 1);
                bytes.drain(line..next);
            }
        }
    }
    bytes
}

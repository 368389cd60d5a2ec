//! Test patterns that both ends compute, so that they need not travel.

/// Marsaglia's 32-bit xorshift with shifts 13, 17, 5 (Journal of Statistical Software 8(14), 2003): fills flash
/// sectors. The first word written is the first output, not the seed.
#[derive(Debug, Clone)]
pub struct Xorshift32(u32);

impl Xorshift32 {
    /// Starts from a seed, which must not be 0; 0 counts as 1.
    #[must_use]
    pub fn new(seed: u32) -> Self {
        Self(if seed == 0 { 1 } else { seed })
    }
}

impl Iterator for Xorshift32 {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        Some(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 723471715, 2497366906, 2064144800 follow 2463534242 in the paper's own program.
    #[test]
    fn follows_the_paper() {
        let words: heapless::Vec<u32, 3> = Xorshift32::new(2_463_534_242).take(3).collect();
        assert_eq!(words.as_slice(), [723_471_715, 2_497_366_906, 2_064_144_800]);
    }
}

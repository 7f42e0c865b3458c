//! Reproducible random numbers. The generator is written here, because a seed in a driver.cfg must give the same faults
//! in every version of tickbus, and a crate may change its generator.

/// Pseudo-random numbers from a seed: `SplitMix64` of Steele, Lea and Flood.
#[derive(Clone, Debug, PartialEq)]
pub struct Random(u64);

impl Random {
    /// The numbers for the fault with number `id`, so that faults, or replies, with the same seed draw different ones.
    pub fn new(seed: u64, id: u32) -> Self {
        let mut random = Self(seed ^ u64::from(id).wrapping_mul(0xA24B_AED4_963E_E407));
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Uniform in [0, 1).
    #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn around_zero(&mut self) -> f64 {
        self.unit().mul_add(2.0, -1.0)
    }

    /// True with probability `chance`.
    pub fn happens(&mut self, chance: f64) -> bool {
        self.unit() < chance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_throws_alike_and_another_fault_does_not() {
        let throws = |seed, id| {
            let mut random = Random::new(seed, id);
            (0..1000)
                .map(|_| random.around_zero())
                .collect::<Vec<f64>>()
        };
        assert_eq!(throws(1, 0), throws(1, 0));
        assert_ne!(throws(1, 0), throws(1, 1));
        assert_ne!(throws(1, 0), throws(2, 0));
        let throws = throws(1, 0);
        assert!(throws.iter().all(|throw| (-1.0..1.0).contains(throw)));
        let mean = throws.iter().sum::<f64>() / 1000.0;
        assert!(mean.abs() < 0.1, "{mean}");
    }

    #[test]
    fn a_seed_gives_the_same_faults_in_every_version() {
        let mut random = Random::new(7, 2);
        assert_eq!(random.next(), 0x75E0_7272_94D7_4C26);
        assert_eq!(random.next(), 0x29F6_02B5_5F84_B464);
    }

    #[test]
    fn what_is_certain_happens_and_what_is_impossible_does_not() {
        let mut random = Random::new(1, 0);
        assert!((0..1000).all(|_| random.happens(1.0)));
        assert!(!(0..1000).any(|_| random.happens(0.0)));
        let count = (0..1000).filter(|_| random.happens(0.25)).count();
        assert!((200..300).contains(&count), "{count}");
    }
}

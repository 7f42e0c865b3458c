//! Pseudo-random numbers that are the same on every machine.

/// A generator after Steele, Lea and Flood ("Fast splittable pseudorandom number generators", 2014).
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

const TWO_TO_53: f64 = 9_007_199_254_740_992.0;

impl Random {
    /// Creates the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next number, evenly distributed from 0 (included) to 1 (excluded).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let unit = ((mixed ^ (mixed >> 31)) >> 11) as f64;
        unit / TWO_TO_53
    }

    /// Returns the next number, evenly distributed between two limits.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.unit()
    }

    /// Returns the next number of a Gaussian distribution with mean 0 and standard deviation 1, limited to ±6. The
    /// number is a sum of twelve evenly distributed ones, since the last bits of `ln` and `cos` differ from library to
    /// library.
    pub fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_numbers_of_the_published_generator() {
        let mut random = Random::new(1_234_567);
        // The first outputs of the reference implementation are 6457827717110365317 and 3203168211198807973.
        for expected in [6_457_827_717_110_365_317_u64, 3_203_168_211_198_807_973] {
            #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
            let expected = (expected >> 11) as f64 / TWO_TO_53;
            assert_eq!(random.unit().to_bits(), expected.to_bits());
        }
    }

    #[test]
    fn the_distributions_have_their_moments() {
        let mut random = Random::new(1);
        let numbers: Vec<f64> = (0..20_000).map(|_| random.gaussian()).collect();
        let mean = numbers.iter().sum::<f64>() / 20_000.0;
        let variance = numbers.iter().map(|n| n * n).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05);
        let numbers: Vec<f64> = (0..1000).map(|_| random.between(2.0, 15.0)).collect();
        assert!(numbers.iter().all(|n| (2.0..15.0).contains(n)));
    }
}

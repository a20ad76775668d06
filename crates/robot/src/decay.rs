//! How much of something is left after a while, by a rate: computed anew only where the while is another one.

/// e^(−rate·t); the bits are those of the same expression computed in every cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decay {
    rate_1_s: f64,
    span_s: f64,
    kept: f64,
}

impl Decay {
    /// With this rate, 1/s.
    pub(crate) const fn new(rate_1_s: f64) -> Self {
        Decay { rate_1_s, span_s: 0.0, kept: 1.0 }
    }

    /// What is kept after a time, s.
    pub(crate) fn kept(&mut self, span_s: f64) -> f64 {
        if span_s != self.span_s {
            (self.span_s, self.kept) = (span_s, (-self.rate_1_s * span_s).exp());
        }
        self.kept
    }

    /// What is kept after a time, s, where the rate, 1/s, may be another one by now.
    pub(crate) fn kept_at(&mut self, rate_1_s: f64, span_s: f64) -> f64 {
        if rate_1_s != self.rate_1_s {
            *self = Decay::new(rate_1_s);
        }
        self.kept(span_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_the_bits_of_the_expression_whichever_times_come() {
        let mut decay = Decay::new(31.4);
        for span_s in [0.001, 0.001, 0.002, 0.001, 0.0, 1.0, f64::INFINITY] {
            assert_eq!(decay.kept(span_s).to_bits(), (-31.4 * span_s).exp().to_bits(), "{span_s}");
        }
        assert!(decay.kept(f64::NAN).is_nan() && decay.kept(0.001) == (-31.4_f64 * 0.001).exp());
        assert!(decay.kept_at(20.0, 0.001) == (-20.0_f64 * 0.001).exp());
        assert!(decay.kept(0.001) == (-20.0_f64 * 0.001).exp());
    }
}

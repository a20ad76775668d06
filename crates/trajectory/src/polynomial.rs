//! Polynomials over the time of one segment.

/// A polynomial of degree five at most: the sum of `coefficients[k]`·tᵏ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Polynomial {
    /// From the constant upwards.
    pub coefficients: [f64; 6],
}

/// Value, speed and acceleration at one end of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct End {
    /// The value.
    pub position: f64,
    /// Its rate.
    pub speed: f64,
    /// The rate of that; a cubic ignores it.
    pub acceleration: f64,
}

impl Polynomial {
    /// The cubic between two ends, `duration_s` apart (a positive time).
    ///
    /// a2 = (3(qf−qi) − (2vi+vf)T)/T², a3 = (2(qi−qf) + (vi+vf)T)/T³.
    pub fn cubic(from: End, to: End, duration_s: f64) -> Polynomial {
        let (t, way) = (duration_s, to.position - from.position);
        let a2 = (3.0 * way - (2.0 * from.speed + to.speed) * t) / (t * t);
        let a3 = (-2.0 * way + (from.speed + to.speed) * t) / (t * t * t);
        Polynomial { coefficients: [from.position, from.speed, a2, a3, 0.0, 0.0] }
    }

    /// The quintic between two ends, `duration_s` apart (a positive time).
    pub fn quintic(from: End, to: End, duration_s: f64) -> Polynomial {
        let t = duration_s;
        // What is left after the Taylor polynomial of the first end, in units of the segment.
        let way = to.position - from.position - from.speed * t - from.acceleration * t * t / 2.0;
        let speed = (to.speed - from.speed - from.acceleration * t) * t;
        let acceleration = (to.acceleration - from.acceleration) * t * t;
        let cube = t * t * t;
        let a3 = (10.0 * way - 4.0 * speed + acceleration / 2.0) / cube;
        let a4 = (-15.0 * way + 7.0 * speed - acceleration) / (cube * t);
        let a5 = (6.0 * way - 3.0 * speed + acceleration / 2.0) / (cube * t * t);
        Polynomial { coefficients: [from.position, from.speed, from.acceleration / 2.0, a3, a4, a5] }
    }

    /// Value and first three derivatives at a time since the segment's beginning.
    pub fn derivatives(&self, time_s: f64) -> [f64; 4] {
        // Horner's rule for all derivatives at once; they come without their factorials. A derivative of an order begins that many
        // coefficients later.
        let [.., c2, c3, c4, c5] = self.coefficients;
        let (mut value, mut first) = (c5 * time_s + c4, c5);
        let mut second = first;
        (first, value) = (first * time_s + value, value * time_s + c3);
        let mut third = second;
        (second, first, value) = (second * time_s + first, first * time_s + value, value * time_s + c2);
        for coefficient in [self.coefficients[1], self.coefficients[0]] {
            third = third * time_s + second;
            second = second * time_s + first;
            first = first * time_s + value;
            value = value * time_s + coefficient;
        }
        [value, first, 2.0 * second, 6.0 * third]
    }

    /// The same polynomial with its time counted from `time_s` on.
    #[must_use]
    pub fn shifted(&self, time_s: f64) -> Polynomial {
        let mut coefficients = self.coefficients;
        // Repeated division by t − time_s (Ruffini and Horner).
        for from in 0..coefficients.len() {
            for at in (from..coefficients.len() - 1).rev() {
                coefficients[at] += time_s * coefficients[at + 1];
            }
        }
        Polynomial { coefficients }
    }
}

/// Derivatives by σ become derivatives by time, for σ with its derivatives by time (F. Faà di Bruno).
pub(crate) fn over_time(f: [f64; 4], [_, p1, p2, p3]: [f64; 4]) -> [f64; 4] {
    [f[0], f[1] * p1, f[2] * p1 * p1 + f[1] * p2, f[3] * p1 * p1 * p1 + 3.0 * f[2] * p1 * p2 + f[1] * p3]
}

//! A knot vector and its basis functions.

/// Highest order that is taken: rounding grows with it, and nothing sensible is near.
pub const HIGHEST_ORDER: usize = 32;

/// Share of the domain by which a range may lie outside it without a word.
const RANGE_SLACK: f64 = 1.0e-6;

/// Why a knot vector cannot be used, as the end of a sentence that begins with the direction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnotsError {
    /// Order 1 has no surface between its points; very high orders are refused.
    #[error("order {0} is not 2 to {HIGHEST_ORDER}")]
    Order(i64),
    /// A span needs as many points as the order.
    #[error("order {order} needs as many points, there are {points}")]
    Points {
        /// As authored.
        order: usize,
        /// As authored.
        points: i64,
    },
    /// Counts that do not fit.
    #[error("{points} points of order {order} need {} knots, there are {knots}", points + order)]
    Count {
        /// As authored.
        points: usize,
        /// As authored.
        order: usize,
        /// As authored.
        knots: usize,
    },
    /// Knots fall, are not finite, or are too large.
    #[error("knots are not finite numbers that never fall")]
    Falling,
    /// No span of the range has a length.
    #[error("knots and range leave nothing between them")]
    Empty,
}

/// A stretch of parameters between two different knots, cut to the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Number of the last knot at or before it: points `knot - degree` to `knot` have a part in it.
    pub knot: usize,
    /// Where it begins.
    pub start: f64,
    /// Where it ends.
    pub end: f64,
}

/// A checked knot vector with the range that is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    degree: usize,
    knots: Vec<f64>,
    spans: Vec<Span>,
}

impl Knots {
    /// Checks order, number of points, knots and range; no range is the whole domain. The second of
    /// the results is true where the range reached outside the domain, and was cut.
    ///
    /// # Errors
    /// See [`KnotsError`].
    pub fn new(
        order: i32,
        points: i32,
        knots: &[f64],
        range: Option<[f64; 2]>,
    ) -> Result<(Self, bool), KnotsError> {
        let order = match usize::try_from(order) {
            Ok(order) if (2..=HIGHEST_ORDER).contains(&order) => order,
            _ => return Err(KnotsError::Order(order.into())),
        };
        let points = match usize::try_from(points) {
            Ok(points) if points >= order => points,
            _ => {
                let points = points.into();
                return Err(KnotsError::Points { order, points });
            }
        };
        if knots.len() != points + order {
            let knots = knots.len();
            return Err(KnotsError::Count {
                points,
                order,
                knots,
            });
        }
        let usable = |k: &f64| k.abs() < 1.0e15;
        if !knots.iter().all(usable) || knots.windows(2).any(|w| w[1] < w[0]) {
            return Err(KnotsError::Falling);
        }
        let (first, last) = (knots[order - 1], knots[points]);
        let [low, high] = range.unwrap_or([first, last]);
        let slack = (last - first) * RANGE_SLACK;
        let cut = !(low >= first - slack && high <= last + slack);
        let (low, high) = (low.max(first), high.min(last));
        let span = |k: usize| Span {
            knot: k,
            start: knots[k].max(low),
            end: knots[k + 1].min(high),
        };
        let spans: Vec<Span> = (order - 1..points)
            .map(span)
            .filter(|s| s.end > s.start)
            .collect();
        if spans.is_empty() {
            return Err(KnotsError::Empty);
        }
        let knots = Self {
            degree: order - 1,
            knots: knots.to_vec(),
            spans,
        };
        Ok((knots, cut))
    }

    /// Degree: order less one.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// Segments, those without a length and those outside the range included: varying primvars have
    /// one value more.
    pub fn segment_count(&self) -> usize {
        self.point_count() - self.degree
    }

    /// Spans in ascending order; one or more.
    pub fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// True where nothing need connect the two sides of the parameter at which `span` begins: its
    /// knot is as often there as the order says.
    pub fn breaks_before(&self, span: &Span) -> bool {
        let at = self.knots[span.knot];
        let same = self.knots[..=span.knot].iter().rev();
        span.start == at && same.take_while(|&&k| k == at).count() > self.degree
    }

    /// How far `u` is through the segment that begins at knot `knot`, 0 to 1.
    pub fn fraction(&self, knot: usize, u: f64) -> f64 {
        let (a, b) = (self.knots[knot], self.knots[knot + 1]);
        ((u - a) / (b - a)).clamp(0.0, 1.0)
    }

    /// Values and slopes at `u` of the `degree + 1` basis functions that are not zero between knots
    /// `knot` and `knot + 1`, those of points `knot - degree` to `knot`. Slices are that long.
    pub fn basis(&self, knot: usize, u: f64, values: &mut [f64], slopes: &mut [f64]) {
        let (p, knots) = (self.degree, &self.knots);
        values[0] = 1.0;
        slopes[0] = 0.0;
        for j in 1..=p {
            if j == p {
                // Slopes are differences of the values of one degree less.
                let mut before = 0.0;
                for r in 0..p {
                    let (a, b) = (knots[knot + 1 + r - p], knots[knot + 1 + r]);
                    let part = p as f64 * values[r] / (b - a);
                    slopes[r] = before - part;
                    before = part;
                }
                slopes[p] = before;
            }
            let mut carried = 0.0;
            for r in 0..j {
                let (a, b) = (knots[knot + 1 + r - j], knots[knot + 1 + r]);
                let part = values[r] / (b - a);
                values[r] = carried + (b - u) * part;
                carried = (u - a) * part;
            }
            values[j] = carried;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recursion that defines basis functions, 0/0 taken as 0.
    fn naive(knots: &[f64], i: usize, p: usize, u: f64, last: f64) -> f64 {
        if p == 0 {
            let ends = knots[i + 1] == last && u == last && knots[i] < last;
            return f64::from(u8::from((knots[i] <= u && u < knots[i + 1]) || ends));
        }
        let part =
            |top: f64, bottom: f64, n: f64| if bottom == 0.0 { 0.0 } else { top / bottom * n };
        part(
            u - knots[i],
            knots[i + p] - knots[i],
            naive(knots, i, p - 1, u, last),
        ) + part(
            knots[i + p + 1] - u,
            knots[i + p + 1] - knots[i + 1],
            naive(knots, i + 1, p - 1, u, last),
        )
    }

    #[test]
    fn basis_functions_are_those_of_the_recursion_and_slopes_their_derivatives() {
        let cases: [(i32, &[f64]); 5] = [
            (2, &[0.0, 0.0, 1.0, 3.0, 3.0]),
            (4, &[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.5, 2.5, 2.5, 2.5]),
            (3, &[-1.0, 0.0, 0.5, 0.5, 2.0, 3.0, 4.0]),
            (4, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
            (
                6,
                &[
                    0.0, 0.1, 0.2, 0.2, 0.3, 0.5, 0.9, 0.9, 1.0, 1.5, 2.0, 2.0, 2.0,
                ],
            ),
        ];
        for (order, knots) in cases {
            let points = knots.len() as i32 - order;
            let (checked, cut) = Knots::new(order, points, knots, None).unwrap();
            assert!(!cut);
            let p = checked.degree();
            let last = knots[points as usize];
            let mut found = [vec![0.0; p + 1], vec![0.0; p + 1]];
            for span in checked.spans().to_vec() {
                for f in [0.0, 0.25, 0.6, 0.999] {
                    let u = span.start + (span.end - span.start) * f;
                    let mut at = |u: f64| {
                        let [values, slopes] = &mut found;
                        checked.basis(span.knot, u, values, slopes);
                        (values.clone(), slopes.clone())
                    };
                    let (values, slopes) = at(u);
                    assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                    assert!(slopes.iter().sum::<f64>().abs() < 1e-12);
                    let h = 1e-6;
                    let (low, high) = (at(u - h).0, at(u + h).0);
                    for r in 0..=p {
                        let want = naive(knots, span.knot - p + r, p, u, last);
                        assert!((values[r] - want).abs() < 1e-13, "{order} {u} {r}");
                        let slope = (high[r] - low[r]) / (2.0 * h);
                        assert!((slopes[r] - slope).abs() < 1e-6, "{order} {u} {r}");
                    }
                }
            }
        }
    }

    #[test]
    fn ranges_cut_spans() {
        let knots = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0];
        let spans = |range| {
            let (knots, cut) = Knots::new(3, 6, &knots, range).unwrap();
            let ends: Vec<_> = knots
                .spans()
                .iter()
                .map(|s| (s.knot, s.start, s.end))
                .collect();
            (ends, cut)
        };
        let all = vec![(2, 0.0, 1.0), (4, 1.0, 2.0), (5, 2.0, 3.0)];
        assert_eq!(spans(None), (all.clone(), false));
        assert_eq!(spans(Some([-1.0, 9.0])), (all, true));
        assert_eq!(
            spans(Some([1.0, 2.5])),
            (vec![(4, 1.0, 2.0), (5, 2.0, 2.5)], false)
        );
        assert_eq!(spans(Some([0.25, 0.5])), (vec![(2, 0.25, 0.5)], false));
        let none = Knots::new(3, 6, &knots, Some([2.0, 1.0]));
        assert_eq!(none.unwrap_err(), KnotsError::Empty);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let ok = [0.0, 0.0, 1.0, 1.0];
        assert!(Knots::new(2, 2, &ok, None).is_ok());
        for order in [i32::MIN, -1, 0, 1, 33, i32::MAX] {
            assert!(matches!(
                Knots::new(order, 2, &ok, None),
                Err(KnotsError::Order(_))
            ));
        }
        for points in [i32::MIN, -1, 0, 1] {
            let refused = Knots::new(2, points, &ok, None);
            assert!(matches!(refused, Err(KnotsError::Points { .. })));
        }
        assert!(matches!(
            Knots::new(2, 3, &ok, None),
            Err(KnotsError::Count { .. })
        ));
        for bad in [
            [0.0, 1.0, 0.5, 1.0],
            [0.0, f64::NAN, 1.0, 1.0],
            [0.0, 0.0, 1.0, f64::INFINITY],
        ] {
            assert!(matches!(
                Knots::new(2, 2, &bad, None),
                Err(KnotsError::Falling)
            ));
        }
        assert!(matches!(
            Knots::new(2, 2, &[1.0; 4], None),
            Err(KnotsError::Empty)
        ));
        let nan = Knots::new(2, 2, &ok, Some([f64::NAN, 1.0]));
        assert!(matches!(nan, Ok((_, true))));
    }

    #[test]
    fn a_knot_as_often_as_the_order_breaks() {
        let knots = [0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0];
        let (knots, _) = Knots::new(2, 5, &knots, None).unwrap();
        let breaks: Vec<_> = knots
            .spans()
            .iter()
            .map(|s| knots.breaks_before(s))
            .collect();
        assert_eq!(breaks, [true, true, false]);
    }
}

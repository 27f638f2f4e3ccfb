//! What is tried again and again, and less often where it was in vain.

/// How often something was tried in vain, or passed over, since it last paid, in one thread's part of a tree, so that what is tried is
/// the same for any number of threads. The first `PATIENCE` are tried, and one of `EVERY` from then on, until one pays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tries<const PATIENCE: u32, const EVERY: u32>(u32);

impl<const PATIENCE: u32, const EVERY: u32> Tries<PATIENCE, EVERY> {
    /// True where the next is to be tried; if it is, what comes of that is to be [told](Self::tried). Else it is passed over.
    pub fn is_due(&mut self) -> bool {
        let due = self.0 < PATIENCE || (self.0 + 1).is_multiple_of(EVERY);
        self.0 += u32::from(!due);
        due
    }

    /// The one that was due was tried, in vain or not.
    pub fn tried(&mut self, in_vain: bool) {
        self.0 = if in_vain { self.0 + 1 } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_is_tried_where_it_was_in_vain() {
        let mut tries = Tries::<4, 16>::default();
        let mut due = |count: u32, pays: &dyn Fn(u32) -> bool| -> Vec<u32> {
            let all = 1..=count;
            all.filter(|&i| {
                let due = tries.is_due();
                if due {
                    tries.tried(!pays(i));
                }
                due
            })
            .collect()
        };
        assert_eq!(due(40, &|_| false), [1, 2, 3, 4, 16, 32]);
        // One that pays has all tried again.
        assert_eq!(due(16, &|i| i == 8), [8, 9, 10, 11, 12]);
        assert_eq!(due(100, &|_| true).len(), 93);
    }
}

//! Tables in Markdown, with columns that line up.

/// A table.
#[derive(Clone, Debug)]
pub struct Table {
    title: String,
    note: String,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(title: &str, note: &str, header: &[&str]) -> Self {
        Self {
            title: title.into(),
            note: note.into(),
            rows: vec![header.iter().map(|&h| h.into()).collect()],
        }
    }

    pub fn row(&mut self, cells: Vec<String>) {
        debug_assert_eq!(cells.len(), self.rows[0].len());
        self.rows.push(cells);
    }

    /// The text, nothing where there are no rows.
    pub fn markdown(&self) -> String {
        if self.rows.len() < 2 {
            return String::new();
        }
        let columns = 0..self.rows[0].len();
        let width = |c: usize| self.rows.iter().map(|r| r[c].chars().count()).max();
        let widths: Vec<usize> = columns.map(|c| width(c).unwrap_or(0).max(3)).collect();
        let mut text = format!("### {}\n\n", self.title);
        if !self.note.is_empty() {
            text += &format!("{}\n\n", self.note);
        }
        for (r, row) in self.rows.iter().enumerate() {
            let padded = row
                .iter()
                .zip(&widths)
                .map(|(cell, &w)| format!(" {cell:<w$} |"));
            text += &format!("|{}\n", padded.collect::<String>());
            if r == 0 {
                let line = widths.iter().map(|w| format!("{}|", "-".repeat(w + 2)));
                text += &format!("|{}\n", line.collect::<String>());
            }
        }
        text + "\n"
    }
}

/// A number with three digits.
pub fn number(x: f64) -> String {
    match x {
        x if !x.is_finite() => "-".into(),
        x if x >= 100.0 => format!("{x:.0}"),
        x if x >= 10.0 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    }
}

/// The best of several rates, and the median in brackets.
pub fn rate(rates: &[f64]) -> String {
    format!("{} ({})", number(best(rates)), number(median(rates)))
}

/// The largest; NaN of none.
pub fn best(rates: &[f64]) -> f64 {
    rates.iter().copied().fold(f64::NAN, f64::max)
}

/// The middle one, or the mean of the two in the middle; NaN of none.
fn median(rates: &[f64]) -> f64 {
    let mut sorted = rates.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_lies_in_the_middle() {
        assert!(median(&[]).is_nan());
        assert_eq!(median(&[3.0]), 3.0);
        assert_eq!(median(&[4.0, 1.0]), 2.5);
        assert_eq!(median(&[9.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 9.0, 2.0]), 3.0);
        assert_eq!(rate(&[1.0, 2.0]), "2.00 (1.50)");
        assert_eq!(rate(&[]), "- (-)");
    }
}

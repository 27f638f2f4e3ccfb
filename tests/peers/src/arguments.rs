//! What is asked for on the command line.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Parser;
use clap::builder::PossibleValuesParser;

use crate::bench::{ORDERS, Options};
use crate::clock::Clock;
use crate::embree::Variant;
use crate::kept::clash;
use crate::scenes::{Family, Shape};

/// More than this nobody needs; whether there is memory for fewer is told by [`Options::fit`].
const MOST_RAYS: usize = 1 << 28;

/// Camera rays that each way of tracing is tried on, about, or a sixteenth of all where that is less. There are so many ways of
/// Embree's that trials of more rays take longer than the rounds.
const TRIAL_RAYS: usize = 1 << 18;

/// Our tracer beside Embree 3, on the same micropolygons and rays.
#[derive(Debug, Parser)]
#[command(name = "peers")]
pub struct Arguments {
    /// Millions of micropolygons, up to 100 [default: 1]
    #[arg(long, value_name = "M", value_parser = millions, conflicts_with = "largest")]
    size: Option<f64>,

    /// The sheet alone, of 48.9 million, on Embree's grids and quads
    #[arg(long, conflicts_with = "quick")]
    largest: bool,

    /// A small run that checks, in about a minute
    #[arg(long)]
    quick: bool,

    /// One family alone, or several by naming it again [default: all]
    #[arg(long, value_parser = PossibleValuesParser::new(Family::ALL.map(Family::name)))]
    scene: Vec<String>,

    /// One order of camera rays alone; without, all and the best of them
    #[arg(long, value_parser = PossibleValuesParser::new(ORDERS))]
    order: Option<String>,

    /// Pixels, multiples of 4 [default: 1280 720]
    #[arg(long, num_args = 2, value_names = ["W", "H"], value_parser = pixels)]
    image: Option<Vec<usize>>,

    /// Pixels across the whole picture, of which --image is the middle [default: no more than the image]
    #[arg(long, value_name = "W", value_parser = positive)]
    across: Option<usize>,

    /// Rays a pixel
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    samples: usize,

    /// Rounds, of which the best counts [default: 3]
    #[arg(long, value_name = "N", value_parser = positive)]
    rounds: Option<usize>,

    /// Rates by processor time, not by the clock on the wall
    #[arg(long)]
    cpu: bool,

    /// Without Embree
    #[arg(long)]
    alone: bool,

    /// Ours also without oriented frames, each in its best way, in turns with the rest; memory's peaks are of both
    #[arg(long)]
    frames: bool,

    /// Writes the tables there too, after each scene those that there are: of a run that is interrupted, these are left
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,

    /// Writes numbers of ours there, after each scene, for scripts/plot_scale.py
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

fn millions(text: &str) -> Result<f64, String> {
    let millions = f64::from_str(text).map_err(|e| e.to_string())?;
    // Written so that NaN fails.
    if millions > 0.0 && millions <= 100.0 {
        Ok(millions)
    } else {
        Err("must be more than 0, and 100 at most".into())
    }
}

fn positive(text: &str) -> Result<usize, String> {
    match usize::from_str(text).map_err(|e| e.to_string())? {
        0 => Err("must be 1 or more".into()),
        n => Ok(n),
    }
}

fn pixels(text: &str) -> Result<usize, String> {
    let n = positive(text)?;
    if n.is_multiple_of(4) {
        Ok(n)
    } else {
        Err("must be a multiple of 4".into())
    }
}

impl Arguments {
    /// The scenes that are asked for, in the order of [`Family::ALL`].
    pub fn families(&self) -> Vec<Family> {
        let asked = |f: &Family| match &self.scene[..] {
            [] => !self.largest || *f == Family::Sheet,
            names => names.iter().any(|name| f.name() == name),
        };
        Family::ALL.into_iter().filter(asked).collect()
    }

    /// What to run on each.
    ///
    /// # Errors
    /// Arguments that do not go together, or ask for more rays than any machine has memory for.
    pub fn options(&self) -> Result<Options, String> {
        if self.largest && self.families() != [Family::Sheet] {
            return Err("--largest has the sheet alone".into());
        }
        if let (Some(a), Some(b)) = (&self.markdown, &self.json)
            && clash(a, b)
        {
            let (a, b) = (a.display(), b.display());
            return Err(format!("--markdown {a} and --json {b} name the same file"));
        }
        let (size, image, rounds) = if self.quick {
            (0.01, [64, 48], 1)
        } else {
            (1.0, [1280, 720], 3)
        };
        let size = if self.largest {
            // 437 x 437 grids of 16 x 16.
            (437.0f64 / 62.5).powi(2)
        } else {
            self.size.unwrap_or(size)
        };
        let image = match self.image.as_deref() {
            Some(&[width, height]) => [width, height],
            _ => image,
        };
        let across = self.across.unwrap_or(image[0]);
        if across < image[0] {
            return Err(format!(
                "--across {across} is less than the {} pixels of the image",
                image[0]
            ));
        }
        let rays = image[0]
            .checked_mul(image[1])
            .and_then(|n| n.checked_mul(self.samples));
        let Some(rays) = rays.filter(|&n| n <= MOST_RAYS) else {
            return Err(format!(
                "{} x {} pixels of {} rays are more than {MOST_RAYS}",
                image[0], image[1], self.samples
            ));
        };
        let orders = ORDERS.into_iter();
        let orders = orders.filter(|&o| self.order.as_deref().is_none_or(|name| o == name));
        Ok(Options {
            millions: size,
            image,
            across,
            samples: self.samples,
            secondary: if self.quick { 2000 } else { 1_000_000 },
            rounds: self.rounds.unwrap_or(rounds),
            clock: if self.cpu { Clock::Cpu } else { Clock::Wall },
            orders: orders.collect(),
            variants: self.variants(),
            checks: if self.quick { 20 } else { 100 },
            screen: if self.quick {
                1
            } else {
                (rays / TRIAL_RAYS).max(16)
            },
            alone: self.alone,
            frames: self.frames,
        })
    }

    /// Those of Embree's that are tried.
    fn variants(&self) -> Vec<Variant> {
        let of = |(shape, high, compact)| Variant {
            shape,
            high,
            compact,
        };
        if self.largest {
            return [Shape::Grid, Shape::Quad]
                .map(|s| of((s, false, false)))
                .into();
        }
        let all = [
            (Shape::Grid, false, false),
            (Shape::Grid, false, true),
            (Shape::Quad, false, false),
            (Shape::Quad, true, false),
            (Shape::Quad, false, true),
            (Shape::Triangle, false, false),
            (Shape::Triangle, true, false),
            (Shape::Triangle, false, true),
        ];
        all.map(of).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(words: &str) -> Result<Options, String> {
        let words = std::iter::once("peers").chain(words.split_whitespace());
        let arguments = Arguments::try_parse_from(words).map_err(|e| e.to_string())?;
        arguments.options()
    }

    #[test]
    fn scenes_come_in_their_order() {
        use Family::{Combed, Fur, Patches, Sheet};
        for (words, families) in [
            ("", &Family::ALL[..]),
            ("--scene fur", &[Fur]),
            ("--scene fur --scene sheet", &[Sheet, Fur]),
            (
                "--scene combed --scene patches --scene combed",
                &[Patches, Combed],
            ),
            ("--largest", &[Sheet]),
            ("--largest --scene sheet", &[Sheet]),
        ] {
            let words: Vec<&str> = ["peers"]
                .into_iter()
                .chain(words.split_whitespace())
                .collect();
            let arguments = Arguments::try_parse_from(&words).unwrap();
            assert_eq!(arguments.families(), families, "{words:?}");
        }
    }

    #[test]
    fn rays_need_memory() {
        let options = asked("").unwrap();
        assert!(options.fit(0).is_ok(), "nobody knows how much there is");
        assert!(options.fit(16 << 30).is_ok());
        let message = options.fit(1 << 30).unwrap_err();
        assert!(message.contains("14.7 million rays"), "{message}");
        // Fewer orders, fewer samples, no Embree: less of it.
        for words in ["--order tile", "--samples 4", "--alone"] {
            let less = asked(words).unwrap().ray_memory();
            assert!(less < options.ray_memory(), "{words}");
        }
        assert!(asked("--quick").unwrap().fit(1 << 27).is_ok());
    }

    #[test]
    fn what_is_not_asked_for_has_its_default() {
        let options = asked("").unwrap();
        assert_eq!((options.millions, options.samples), (1.0, 16));
        assert_eq!((options.image, options.rounds), ([1280, 720], 3));
        assert_eq!(options.across, 1280);
        let middle = asked("--image 480 272 --across 1280").unwrap();
        assert_eq!((middle.image, middle.across), ([480, 272], 1280));
        assert_eq!((options.orders.len(), options.variants.len()), (4, 8));
        // Whatever comes first.
        for words in [
            "--quick --rounds 2 --image 8 4",
            "--image 8 4 --rounds 2 --quick",
        ] {
            let options = asked(words).unwrap();
            assert_eq!((options.image, options.rounds), ([8, 4], 2));
            assert_eq!(options.millions, 0.01);
        }
        let options = asked("--largest --order block").unwrap();
        assert!((options.millions - 48.9).abs() < 0.1);
        assert_eq!((options.orders, options.variants.len()), (vec!["block"], 2));
    }

    #[test]
    fn what_cannot_be_run_is_refused_by_name() {
        for (words, told) in [
            ("--size 0", "more than 0"),
            ("--size nan", "more than 0"),
            ("--size 1e9", "100 at most"),
            ("--size x", "invalid float"),
            ("--size", "--size <M>"),
            ("--samples 0", "1 or more"),
            ("--samples -1", "-1"),
            ("--rounds 0", "1 or more"),
            ("--image 6 4", "multiple of 4"),
            ("--image 8", "2 values"),
            ("--image 8 4 --across 7", "less than the 8 pixels"),
            ("--across 0", "1 or more"),
            ("--image 100000 100000", "are more than"),
            ("--samples 18446744073709551615", "are more than"),
            ("--scene hair", "sheet, patches, fur, combed"),
            ("--order row", "tile, block, pixel, surface"),
            ("--largest --scene fur", "the sheet alone"),
            ("--largest --scene sheet --scene fur", "the sheet alone"),
            ("--markdown f --json f", "--markdown f and --json f name"),
            (
                "--markdown f --json ./f",
                "--markdown f and --json ./f name",
            ),
            ("--largest --size 2", "cannot be used with"),
            ("--largest --quick", "cannot be used with"),
            ("--bogus", "--bogus"),
        ] {
            let message = asked(words).expect_err(words);
            assert!(message.contains(told), "{words}: {message}");
        }
    }
}

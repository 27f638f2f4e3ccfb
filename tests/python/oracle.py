"""The blur oracle: a render over a shutter is the mean of renders at single times.

Single times are shutters of zero length, so everything is read, diced and traced for that one
time, and compared with the one render that blurs. Both sides are estimates of the same image. Each
is made of REPLICATES independent ones, and the spread of these tells how far the two may be
apart; times are stratified at random, one in each of TIMES equal parts of the shutter.
"""

import numpy as np
from scenes import render

REPLICATES = 4
TIMES = 24


def stratified(rng, count):
    """One random number in each of `count` equal parts of [0, 1)."""
    return (np.arange(count) + rng.random(count)) / count


def estimate(images):
    """Mean of independent images, and its variance averaged over pixels and channels."""
    images = np.stack(images)
    variance = images.var(axis=0, ddof=1).mean() / len(images)
    return images.mean(axis=0), float(variance)


def blurred(stage, samples=64, **settings):
    """The render that blurs, from independent seeds."""
    return estimate(
        [
            render(stage, samples=samples, seed=1000 + i, **settings)["color"]
            for i in range(REPLICATES)
        ]
    )


def mean_over(parts, render_one):
    """The mean of `render_one(part, seed)` over each of REPLICATES lists of parts."""
    replicates = []
    for r, replicate in enumerate(parts):
        images = [render_one(part, r * 1000 + i) for i, part in enumerate(replicate)]
        replicates.append(np.mean(images, axis=0))
    return estimate(replicates)


def mean_over_times(stage, **settings):
    """The mean of renders with shutters of zero length within [0, 1]."""
    rng = np.random.default_rng(7)
    return mean_over(
        [stratified(rng, TIMES) for _ in range(REPLICATES)],
        lambda t, seed: render(stage, shutter=(t, t), seed=seed, **settings)["color"],
    )


def agree(a, b):
    """(whether two estimates are of the same image, a sentence with the figures).

    The mean square difference of two independent unbiased estimates is the sum of their
    variances; it is an average over thousands of values, so twice that is far outside.
    """
    square = float(np.mean((a[0] - b[0]) ** 2))
    expected = a[1] + b[1] + 1e-8
    return square < 2.0 * expected, f"mean square {square:.3g}, expected {expected:.3g}"

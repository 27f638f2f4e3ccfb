"""The blur oracle: a render over a shutter is the mean of renders at single times.

Single times are shutters of zero length, so everything is read, diced and traced for that one
time, and compared with the one render that blurs. Times are stratified at random: one in each of n equal
parts. Both sides are then unbiased estimates of the same image, and their difference has a
variance that the spread of the single renders bounds.
"""

import numpy as np
from scenes import render


def single_times(stage, count=96, shutter=(0.0, 1.0), seed=7, frame=0.0, **settings):
    """Colors of renders at `count` times: (count, height, width, 4)."""
    rng = np.random.default_rng(seed)
    times = (np.arange(count) + rng.random(count)) / count
    times = shutter[0] + times * (shutter[1] - shutter[0])
    # A seed of its own for each: their sampling errors must not add up.
    return np.stack(
        [
            render(stage, frame, shutter=(t, t), seed=i, **settings)["color"]
            for i, t in enumerate(times)
        ]
    )


def disagreement(blurred, singles, samples):
    """RMS difference of an image of `samples` and the mean of `singles`, and its bound.

    The bound is what independent samples would give, three standard deviations of them. Stratified
    ones do better. Below it all differences are noise.
    """
    mean, variance = singles.mean(axis=0), singles.var(axis=0)
    rms = float(np.sqrt(np.mean((blurred - mean) ** 2)))
    bound = 3.0 * float(np.sqrt(np.mean(variance) * (1.0 / samples + 1.0 / len(singles)) / 4.0))
    return rms, bound + 1e-4

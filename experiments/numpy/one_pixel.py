"""Recomputes the first pass of `--denoiser prpf` at one pixel from the arrays of `prpf export`.

    python3 experiments/numpy/one_pixel.py FILE.npz [X Y]

Follows P-RPF (Park, Moon, Kim and Yoon): similar neighbours (Eqs. 1 to 3), mutual information of their samples and the
resulting weights (Eqs. 5 to 10 of section 4.2), joint bilateral filter (Eq. 4). src/filter/prpf documents the
interpretations of what the paper leaves open.
"""

import json
import sys

import numpy as np

WINDOW = 55  # of the first pass
Z, Z_WORLD = 3.0, 30.0  # similarity thresholds in standard deviations
MIN_THRESHOLD, MIN_THRESHOLD_WORLD = 0.1, 0.001  # absolute
SIDE = 9  # columns and rows of the window that statistics come from
SAMPLES = 2048  # for mutual information
SPACING = 5  # of the grid's nodes
DAMPING = 2.0  # factor of randomness in the weights of colours
SIGMA8_SQUARED = 0.002
MIN_INFORMATION = 1e-4  # bits, added to each estimate
MIN_SAMPLES = 32
EXPONENT_CUT = 40.0
CONSTANT = 1e-6  # relative standard deviation below which a dimension is constant
MEDIANS, DEVIATIONS, HALF_FRACTION = 8.0, 4.0, 0.8  # firefly clamp
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Pcg32:
    """O'Neill's random number generator, which selects the samples of mutual information."""

    def __init__(self, state, stream):
        self.increment = (stream << 1 | 1) & (1 << 64) - 1
        self.state = (state + self.increment) & (1 << 64) - 1
        self._step()

    def _step(self):
        self.state = (self.state * 6364136223846793005 + self.increment) & (1 << 64) - 1

    def uniform(self):
        """Uniform in [0, 1)."""
        state = self.state
        self._step()
        word, rotation = (state >> 18 ^ state) >> 27 & 0xFFFFFFFF, state >> 59
        return ((word >> rotation | word << (-rotation & 31)) & 0xFFFFFFFF) / 2.0**32


class Guide:
    """Means and variances of all pixels, from which distances are computed: features first, then colours.

    In single precision, as in the filter, because rounding decides whether distances at the threshold are similar.
    """

    def __init__(self, data):
        groups, names, units = (data[f"dimension_{kind}"] for kind in ("groups", "names", "units"))
        self.features = np.flatnonzero(groups == "feature")
        self.randoms = np.flatnonzero(groups == "random")
        self.film = np.flatnonzero(groups == "position")
        radiance = np.flatnonzero(np.char.startswith(names, "radiance"))
        self.radiance = radiance if len(radiance) else np.flatnonzero(groups == "colour")
        count = self.count = data["count"].astype(float)
        parts = {s: data[f"mean{s}"][self.radiance].astype(np.float32) for s in ("", "_a", "_b")}
        mean = {s: np.where(data[f"count{s}"] > 0, values, np.float32(0)) for s, values in parts.items()}
        for half in ("_a", "_b"):
            mean[half] = np.where(data[f"count{half}"] > 0, mean[half], mean[""])
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.where(count >= 2, data["m2"] / (count - 1), 0.0).astype(np.float32)
        colour, scale = clamp_fireflies(mean, data["count_a"], data["count_b"])
        average = colour.mean(dtype=float)
        self.normalisation = 2.0 ** -np.round(np.log2(average)) if average > 0 else 1.0
        single = [data["mean"][self.features], colour * self.normalisation]
        self.means = np.concatenate(single).astype(np.float32)
        single = [variance[self.features], variance[self.radiance] * scale**2 * self.normalisation**2]
        variances = np.concatenate(single).astype(np.float32)
        pooled = np.array([pool(m, v, count) for m, v in zip(self.means, variances)])
        n = count.flat[0]
        even = n >= 2 and (count == n).all()
        self.within = variances * (n - 1) / n if even else pooled
        world = np.array([unit.startswith("scene") for unit in units[self.features]])[:, None, None]
        z, min_threshold = (np.where(world, *values).astype(np.float32) for values in ((Z_WORLD, Z), (MIN_THRESHOLD_WORLD, MIN_THRESHOLD)))
        pooled = pooled[: len(self.features)]
        least = np.where(pooled <= min_threshold**2, min_threshold**2, np.float32(0))
        self.thresholds = np.where(count > 0, np.maximum(z**2 * pooled, least), np.float32(np.inf))
        self.means[:, count == 0] = 0.0
        hit = data["mean"][names == "hit"][0].astype(np.float32) if "hit" in names else np.ones_like(count)
        self.hit, self.own_hit = np.where(count > 0, hit, 4.0), np.where(count > 0, hit, 0.5)

    def is_similar(self, x, y, rows, columns):
        """Returns which pixels of `rows` × `columns` are similar to (x, y)."""
        f = len(self.features)
        others = self.means[:f][:, rows][:, :, columns]
        near = (others - self.means[:f, y, x][:, None, None]) ** 2 <= self.thresholds[:, y, x][:, None, None]
        return near.all(axis=0) & (abs(self.own_hit[y, x] - self.hit[np.ix_(rows, columns)]) <= 0.5)

    def neighbourhood(self, x, y):
        """Returns mean and variance of each dimension over the similar pixels among some of the window."""
        steps = SIDE // 2
        offsets = np.array([round_half_up(t * (WINDOW // 2) / steps) for t in range(-steps, steps + 1)])
        height, width = self.count.shape
        rows, columns = (o[(o >= 0) & (o < size)] for o, size in ((y + offsets, height), (x + offsets, width)))
        similar = self.is_similar(x, y, rows, columns)
        means, within = (a[:, rows][:, :, columns][:, similar].astype(float) for a in (self.means, self.within))
        mean = means.mean(axis=1)
        return mean, ((means - mean[:, None]) ** 2 + within).mean(axis=1)

    def constant(self, mean, variance):
        return variance <= (CONSTANT * np.maximum(abs(mean), 1.0)) ** 2


def round_half_up(value):
    return int(np.floor(abs(value) + 0.5) * np.sign(value))


def pool(mean, variance, count):
    """Pools each pixel's variance with those of its 3×3 neighbourhood, which counts as two more samples."""
    height, width = count.shape
    count = count.astype(np.float32)
    known, total = np.zeros_like(mean), np.zeros_like(mean)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            to = np.s_[max(0, -dy) : height - max(0, dy), max(0, -dx) : width - max(0, dx)]
            of = np.s_[max(0, dy) : height - max(0, -dy), max(0, dx) : width - max(0, -dx)]
            known[to] += count[of] >= 2
            total[to] += np.where(count[of] >= 2, variance[of], np.float32(0))
    left = np.concatenate([mean[:, 1:2] if width > 1 else mean, mean[:, :-1]], axis=1)
    single = (mean - left) ** 2 / 2 * count
    pooled = np.where(known > 0, total / np.maximum(known, 1), single)
    own = np.maximum(count - 1, 0)
    return (2 * pooled + own * variance) / (2 + own)


def clamp_fireflies(mean, count_a, count_b):
    """Returns the clamped colours, and the fraction of their luminance that remains."""
    luminance = {part: np.tensordot(LUMINANCE, m, 1) for part, m in mean.items()}
    of_a, of_b = luminance["_a"] * count_a, luminance["_b"] * count_b
    colour, scale = mean[""].copy(), np.ones_like(of_a)
    for y, x in np.argwhere(np.maximum(of_a, of_b) > HALF_FRACTION * (of_a + of_b)):
        own = luminance[""][y, x]
        around = luminance[""][max(0, y - 2) : y + 3, max(0, x - 2) : x + 3].ravel()
        median = np.sort(around)[len(around) // 2]
        if median <= 0 or 2 * (around < own / MEDIANS).sum() <= len(around):
            continue
        bound = MEDIANS * median + DEVIATIONS * 1.48 * np.sort(abs(around - median))[len(around) // 2]
        if own <= bound:
            continue
        a, b = (mean[h][:, y, x] * min(1.0, bound / max(luminance[h][y, x], bound)) for h in ("_a", "_b"))
        n_a, n_b = float(count_a[y, x]), float(count_b[y, x])
        colour[:, y, x] = (n_a * a + n_b * b) / (n_a + n_b)
        scale[y, x] = LUMINANCE @ colour[:, y, x] / own
    return colour, scale


def select_samples(data, guide, x, y, cluster):
    """Returns the pixel's samples in the reservoir, then one from each of equal parts of the cluster, at most
    `SAMPLES` in all."""
    reservoir, counts = data["reservoir"], data["reservoir_count"]
    own = list(reservoir[y, x, : counts[y, x]][:SAMPLES])
    others = SAMPLES - counts[y, x]
    if len(cluster) <= SAMPLES and sum(int(counts[j]) for j in cluster) <= SAMPLES:
        return np.array(own + [s for j in cluster if j != (y, x) for s in reservoir[j][: counts[j]]])
    seed = json.loads(str(data["header"]))["settings"]["seed"]
    random = Pcg32(seed ^ (y * counts.shape[1] + x), 0)
    last, repeats = None, 0
    for s in range(others):
        p = int((s + random.uniform()) * (len(cluster) / others))
        p = (p + 1) % len(cluster) if cluster[p] == (y, x) else p
        repeats = repeats + 1 if p == last else 0
        last, j = p, cluster[p]
        number = (j[0] * counts.shape[1] + j[1]) ^ seed & 0xFFFFFFFF
        first = (number * 0x9E3779B9 & 0xFFFFFFFF) >> 16
        own.append(reservoir[j][(first + repeats) % counts[j]])
    return np.array(own)


def information(a, b):
    """Estimates the mutual information of two variables in bits, from histograms. A bin is one standard deviation wide;
    the outer bins are open."""
    joint = np.zeros((5, 5))
    np.add.at(joint, (a, b), 1 / len(a))
    outer = np.outer(joint.sum(axis=1), joint.sum(axis=0))
    occupied = joint > 0
    return max(0.0, float((joint[occupied] * np.log2(joint[occupied] / outer[occupied])).sum()))


def weights(data, guide, x, y):
    """Returns the cluster's size, β of each feature, α of each colour, and the fraction of randomness in the colour."""
    height, width = guide.count.shape
    radius = WINDOW // 2
    rows = np.arange(max(0, y - radius), min(height, y + radius + 1))
    columns = np.arange(max(0, x - radius), min(width, x + radius + 1))
    similar = np.argwhere(guide.is_similar(x, y, rows, columns))
    cluster = [(int(rows[j]), int(columns[i])) for j, i in similar]
    samples = select_samples(data, guide, x, y, cluster).astype(float)

    mean, variance = guide.neighbourhood(x, y)
    scale = np.where(guide.constant(mean, variance), 0.0, 1 / np.sqrt(np.maximum(variance, 1e-300)))
    of_film = []
    for axis, dim in enumerate(guide.film):
        offsets = np.array([j[1 - axis] - (x, y)[axis] for j in cluster], float)
        deviation = np.sqrt(offsets.var() + 1 / 12)
        of_film.append((data["mean"][dim, y, x] + offsets.mean(), 1 / deviation))
    normalisation = np.where(np.arange(len(mean)) < len(guide.features), 1.0, guide.normalisation)
    standard = [(0.5, np.sqrt(12.0))] * len(guide.randoms) + of_film + list(zip(mean / normalisation, scale * normalisation))
    dims = [*guide.randoms, *guide.film, *guide.features, *guide.radiance]
    bins = [np.clip(np.floor((samples[:, dim] - m) * s + 2.5), 0, 4).astype(int) for dim, (m, s) in zip(dims, standard)]

    r, p = len(guide.randoms), len(guide.randoms) + len(guide.film)
    f = p + len(guide.features)

    def randomness(bits):
        random, film = (sum(group) + MIN_INFORMATION * len(group) for group in (bits[:r], bits[r:p]))
        return random / (random + film)

    if len(samples) < MIN_SAMPLES:
        return len(cluster), np.concatenate([np.full(f - p, 1 / max(f - p, 1)), np.zeros(3), [randomness([0.0] * p)]])
    of_colours = [[information(bins[c], bins[k]) for k in range(f)] for c in range(f, f + 3)]
    fractions = [randomness(bits) for bits in of_colours]
    alpha = [max(0.0, 1 - DAMPING * fraction) for fraction in fractions]
    total = np.sum(of_colours)
    beta = []
    for k in range(p, f):
        own = randomness([information(bins[k], bins[j]) for j in range(p)])
        beta.append(sum(bits[k] for bits in of_colours) / max(total, 1e-38) * max(0.0, 1 - own))
    return len(cluster), np.concatenate([beta, alpha, [np.mean(fractions)]])


def filtered(guide, x, y, weight):
    """Returns the linear radiance of the joint bilateral filter at one pixel."""
    height, width = guide.count.shape
    radius = WINDOW // 2
    rows = np.arange(max(0, y - radius), min(height, y + radius + 1))
    rows = rows[(rows - y) % 2 == 0]  # every second one contributes
    columns = np.arange(max(0, x - radius), min(width, x + radius + 1))
    mean, variance = guide.neighbourhood(x, y)
    n, randomness = guide.count.mean() * (guide.count[y, x] > 0), weight[-1]
    factor = (1 - randomness) ** 2 / (16 * SIGMA8_SQUARED)
    inverse_bandwidth = np.where(guide.constant(mean, variance), 0.0, weight[:-1] * n * factor / np.maximum(variance, 1e-300))
    others = guide.means[:, rows][:, :, columns].astype(float)
    exponent = np.tensordot(inverse_bandwidth, (others - guide.means[:, y, x][:, None, None]) ** 2, 1)
    deviation = WINDOW / 4
    exponent += ((rows - y)[:, None] ** 2 + (columns - x)[None, :] ** 2) / (2 * deviation**2)
    similar = guide.is_similar(x, y, rows, columns) & (exponent <= EXPONENT_CUT)
    weights = np.where(similar, np.exp(-exponent), 0.0)
    return (others[-3:] * weights).sum(axis=(1, 2)) / weights.sum() / guide.normalisation


def node(at, size):
    """Returns the node of the grid's cell that contains `at`. Weights are computed at nodes and interpolated elsewhere."""
    return min(at // SPACING * SPACING + SPACING // 2, size - 1)


def main(path, *pixel):
    data = dict(np.load(path))
    if "first_pass" not in data:
        sys.exit(f"{path}: the array `first_pass` is missing; `prpf export` writes it for states of `--denoiser prpf`")
    guide = Guide(data)
    height, width = guide.count.shape
    x, y = (int(v) for v in pixel) if pixel else (width // 2, height // 2)
    if not (0 <= x < width and 0 <= y < height):
        sys.exit(f"pixel {x}, {y} is outside the image of {width} x {height} pixels")
    x, y = node(x, width), node(y, height)
    size, ours = weights(data, guide, x, y)
    theirs = data["feature_weights"][0, :-1, y, x]
    print(f"pixel {x}, {y}: {size} of the {WINDOW}x{WINDOW} pixels around it are similar")
    print(f"{'weight':24} {'numpy':>12} {'prpf':>12} {'difference':>12}")
    for name, a, b in zip(data["feature_weight_names"], ours, theirs):
        print(f"{name:24} {a:12.6f} {b:12.6f} {a - b:12.1e}")
    mine, other = filtered(guide, x, y, ours), data["first_pass"][:, y, x]
    for name, a, b in zip("RGB", mine, other):
        print(f"{'filtered ' + name:24} {a:12.6f} {b:12.6f} {a - b:12.1e}")
    worst = max(abs(ours - theirs).max(), (abs(mine - other) / np.maximum(abs(other), 1e-6)).max())
    print(f"largest difference {worst:.1e}, relative for filtered values")
    return 0 if worst < 1e-3 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

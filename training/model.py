"""The learned filter: a small network predicts the affinities of edge-avoiding à-trous kernels from sample statistics.

The network sees the image at half its resolution (2×2 pixels are channels of one) and predicts, per pixel: for every
level of the à-trous filter six features, a weight as a neighbour and a weight of its own; and how the results are
mixed. The kernels are exp(−|f_p − f_q|² + a_q) (Işık et al. 2021, Interactive Monte Carlo Denoising using Affinity of
Neural Features). Given the statistics the filter is linear in the samples' values.

Arrays are [batch, channels, height, width] but inside the network, where channels come last.
"""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np

from kernels import filter_images

DILATIONS = (1, 2, 4, 8, 16, 32, 2, 1)
FEATURES = 6
# Per level features, neighbour weight, own weight; then the mix of four images, of albedo, and of emission.
OUTPUTS = len(DILATIONS) * (FEATURES + 2) + 6
ALBEDO_FLOOR = 0.02

# Channels of what the filter gets. `deviation` is that of the samples' luminance, `difference` that of the luminances of
# the halves; other deviations are means over the axes, that of the position in units of its mean. `nlm` is the image of
# that denoiser, `has_nlm` 0 or 1.
STATISTICS = {
    "colour": 3,
    "deviation": 1,
    "difference": 1,
    "emission": 3,
    "albedo": 3,
    "albedo_deviation": 1,
    "normal": 3,
    "normal_deviation": 1,
    "second_normal": 3,
    "position_deviation": 1,
    "hit": 1,
    "count": 1,
    "nlm": 3,
    "has_nlm": 1,
}
Statistics = namedtuple("Statistics", STATISTICS)

# Name, input and output channels, kernel side.
INPUTS = 25
LAYERS = [
    ("enter", 4 * INPUTS, 48, 3),
    ("down1a", 48, 64, 3),
    ("down1b", 64, 64, 3),
    ("down2a", 64, 96, 3),
    ("down2b", 96, 96, 3),
    ("down3", 96, 96, 3),
    ("up2", 96 + 96, 96, 3),
    ("up1", 96 + 64, 48, 3),
    ("up0", 48 + 48, 48, 3),
    ("leave", 48, 4 * OUTPUTS, 1),
]


def initial(seed):
    """Draws the weights, with the deviations of He et al. 2015."""
    draw = np.random.default_rng(seed)
    parameters = {}
    for name, fan_in, fan_out, side in LAYERS:
        deviation = np.sqrt(2 / (fan_in * side * side)) * (0.1 if name == "leave" else 1)
        shape = (side, side, fan_in, fan_out)
        parameters[name] = (draw.normal(0, deviation, shape).astype(np.float32), np.zeros(fan_out, np.float32))
    return parameters


def convolve(parameters, name, x, is_active=True):
    weights, bias = parameters[name]
    y = jax.lax.conv_general_dilated(x, weights, (1, 1), "SAME", dimension_numbers=("NHWC", "HWIO", "NHWC")) + bias
    return jax.nn.leaky_relu(y, 0.05) if is_active else y


def shrink(x):
    b, h, w, c = x.shape
    return x.reshape(b, h // 2, 2, w // 2, 2, c).mean((2, 4))


def grow(x):
    return jnp.repeat(jnp.repeat(x, 2, 1), 2, 2)


def to_depth(x):
    b, h, w, c = x.shape
    return x.reshape(b, h // 2, 2, w // 2, 2, c).transpose(0, 1, 3, 2, 4, 5).reshape(b, h // 2, w // 2, 4 * c)


def to_space(x):
    b, h, w, c = x.shape
    return x.reshape(b, h, w, 2, 2, c // 4).transpose(0, 1, 3, 2, 4, 5).reshape(b, 2 * h, 2 * w, c // 4)


def luminance(rgb):
    return 0.2126 * rgb[:, 0:1] + 0.7152 * rgb[:, 1:2] + 0.0722 * rgb[:, 2:3]


def network_inputs(s):
    """Maps statistics to [batch, INPUTS, height, width] of numbers near 1."""
    divisor = jnp.maximum(s.albedo, ALBEDO_FLOOR)
    level = luminance(s.colour)
    relative = 10 / (level + 0.01)
    inputs = [
        jnp.log1p(10 * s.colour / divisor),
        jnp.log1p(10 * level),
        jnp.log1p(relative * s.deviation / jnp.sqrt(jnp.maximum(s.count, 1))),
        jnp.log1p(relative * jnp.abs(s.difference)),
        s.albedo,
        s.albedo_deviation,
        s.normal,
        s.normal_deviation,
        s.second_normal,
        jnp.log1p(s.position_deviation),
        s.hit,
        jnp.log1p(luminance(s.emission)),
        jnp.log2(jnp.maximum(s.count, 1)) / 6,
        s.has_nlm * jnp.log1p(10 * jnp.maximum(s.nlm - s.emission, 0) / divisor),
        s.has_nlm,
    ]
    inputs = jnp.concatenate(inputs, 1)
    assert inputs.shape[1] == INPUTS, inputs.shape
    return inputs


def network(parameters, inputs):
    """Maps [b, INPUTS, h, w] to [b, OUTPUTS, h, w]; h and w are multiples of 16."""
    x0 = convolve(parameters, "enter", to_depth(inputs.transpose(0, 2, 3, 1)))
    x1 = convolve(parameters, "down1b", convolve(parameters, "down1a", shrink(x0)))
    x2 = convolve(parameters, "down2b", convolve(parameters, "down2a", shrink(x1)))
    x3 = convolve(parameters, "down3", shrink(x2))
    y2 = convolve(parameters, "up2", jnp.concatenate([grow(x3), x2], -1))
    y1 = convolve(parameters, "up1", jnp.concatenate([grow(y2), x1], -1))
    y0 = convolve(parameters, "up0", jnp.concatenate([grow(y1), x0], -1))
    return to_space(convolve(parameters, "leave", y0, False)).transpose(0, 3, 1, 2)


def denoise(parameters, s):
    """The image [b, 3, h, w] of statistics, and the one of the predicted kernels alone."""
    outputs = network(parameters, network_inputs(s))
    divisor = jnp.maximum(s.albedo, ALBEDO_FLOOR)
    values = jnp.concatenate([s.colour / divisor, divisor, s.colour, s.emission], 1)
    filtered = filter_images(FEATURES, DILATIONS, outputs, s.hit, values)
    demodulated, soft_albedo, plain, soft_emission = jnp.split(filtered, 4, 1)
    of_images, of_albedo, of_emission = outputs[:, -6:-2], outputs[:, -2:-1], outputs[:, -1:]
    # Bounded, so that no candidate is lost for good
    of_images = 8 * jnp.tanh(of_images / 8)
    of_images = jax.nn.softmax(of_images.at[:, 3:].set(jnp.where(s.has_nlm > 0, of_images[:, 3:], -jnp.inf)), 1)
    textured = demodulated * (divisor + jax.nn.sigmoid(of_albedo) * (soft_albedo - divisor))
    images = [textured, plain, s.colour, s.nlm - s.emission]
    image = sum(of_images[:, k : k + 1] * x for k, x in enumerate(images))
    shown = s.emission + jax.nn.sigmoid(of_emission) * (soft_emission - s.emission)
    return image + shown, textured + shown

"""The learned filter: a small network predicts the affinities of edge-avoiding à-trous kernels from sample statistics.

The network sees the image at half its resolution (2×2 pixels are channels of one) and predicts, per pixel: for every
level of the à-trous filter six features, a weight as a neighbour and a weight of its own; and how the results are
mixed. The kernels are exp(−|f_p − f_q|² + a_q) (Işık et al. 2021, Interactive Monte Carlo Denoising using Affinity of
Neural Features). Given the statistics the filter is linear in the samples' values.
"""

import jax
import jax.numpy as jnp
import numpy as np

DILATIONS = [1, 2, 4, 8, 16]
FEATURES = 6
# Per level features, neighbour weight, own weight; then the mix of three images, of albedo, and of emission.
OUTPUTS = len(DILATIONS) * (FEATURES + 2) + 5
ALBEDO_FLOOR = 0.02

# Name, input and output channels, kernel side.
INPUTS = 21
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


def network(parameters, inputs):
    """Maps inputs [b, h, w, INPUTS] to outputs [b, h, w, OUTPUTS]; h and w are multiples of 16."""
    x0 = convolve(parameters, "enter", to_depth(inputs))
    x1 = convolve(parameters, "down1b", convolve(parameters, "down1a", shrink(x0)))
    x2 = convolve(parameters, "down2b", convolve(parameters, "down2a", shrink(x1)))
    x3 = convolve(parameters, "down3", shrink(x2))
    y2 = convolve(parameters, "up2", jnp.concatenate([grow(x3), x2], -1))
    y1 = convolve(parameters, "up1", jnp.concatenate([grow(y2), x1], -1))
    y0 = convolve(parameters, "up0", jnp.concatenate([grow(y1), x0], -1))
    return to_space(convolve(parameters, "leave", y0, False))


def shifted(x, dy, dx):
    """x at the neighbour (y + dy, x + dx); the nearest pixel's beyond the border."""
    h, w = x.shape[1:3]
    padded = jnp.pad(x, ((0, 0), (abs(dy),) * 2, (abs(dx),) * 2, (0, 0)), mode="edge")
    return padded[:, abs(dy) + dy : abs(dy) + dy + h, abs(dx) + dx : abs(dx) + dx + w]


def filter_values(outputs, values):
    """Filters values [b, h, w, c] by the predicted kernels, level by level."""
    for level, dilation in enumerate(DILATIONS):
        start = level * (FEATURES + 2)
        features = outputs[..., start : start + FEATURES]
        neighbour = jnp.clip(outputs[..., start + FEATURES : start + FEATURES + 1], -20, 20)
        own = jnp.exp(jnp.clip(outputs[..., start + FEATURES + 1 : start + FEATURES + 2], -20, 20))
        total, norm = own * values, own
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                if dy == dx == 0:
                    continue
                other = shifted(jnp.concatenate([features, neighbour, values], -1), dy * dilation, dx * dilation)
                distance = jnp.sum((other[..., :FEATURES] - features) ** 2, -1, keepdims=True)
                weight = jnp.exp(other[..., FEATURES : FEATURES + 1] - distance)
                total, norm = total + weight * other[..., FEATURES + 1 :], norm + weight
        values = total / norm
    return values


def denoise(parameters, inputs, colour, albedo, emission):
    """The image [b, h, w, 3] from the statistics of `data.statistics`."""
    outputs = network(parameters, inputs)
    divisor = jnp.maximum(albedo, ALBEDO_FLOOR)
    values = jnp.concatenate([colour / divisor, divisor, colour, emission], -1)
    filtered = filter_values(outputs, values)
    demodulated, soft_albedo, plain, soft_emission = jnp.split(filtered, 4, -1)
    mix = outputs[..., -5:]
    of_images = jax.nn.softmax(mix[..., :3])
    of_albedo, of_emission = jax.nn.sigmoid(mix[..., 3:4]), jax.nn.sigmoid(mix[..., 4:5])
    textured = demodulated * (divisor + of_albedo * (soft_albedo - divisor))
    image = of_images[..., :1] * textured + of_images[..., 1:2] * plain + of_images[..., 2:] * colour
    return image + emission + of_emission * (soft_emission - emission)

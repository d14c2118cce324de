"""Scenes and stores that several tests use."""

import numpy as np
import pytest

import prpf

SCENE = """
Film "rgb" "integer xresolution" 40 "integer yresolution" 24
Sampler "independent" "integer pixelsamples" 4
WorldBegin
LightSource "infinite" "rgb L" [ 0.2 0.2 0.3 ]
LightSource "point" "rgb I" [ 20 20 18 ] "point3 from" [ 2 3 0 ]
Material "diffuse" "rgb reflectance" [ 0.8 0.2 0.1 ]
Translate 0 0 4 Shape "sphere"
Material "diffuse" "rgb reflectance" [ 0.4 0.5 0.4 ]
Shape "disk" "float radius" 6 "float height" 1
"""

FEATURES = ["R", "G", "B", "albedo.r", "albedo.g", "albedo.b", "N1.x", "N1.y", "N1.z"]


@pytest.fixture(scope="session")
def scene():
    return prpf.Scene.parse(SCENE)


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "sphere.pbrt"
    path.write_text(SCENE)
    return path


@pytest.fixture
def rendered(scene):
    store = scene.store(reservoir=8)
    scene.render(store, 8)
    return store


def made_up_samples(height, width, samples, seed=0):
    """Noisy samples of two flat surfaces, in the order of FEATURES, with the noise-free image."""
    random = np.random.default_rng(seed)
    values = np.zeros((height, width, samples, len(FEATURES)), np.float32)
    values[..., 3:6] = 0.2
    values[:, width // 2 :, :, 3:6] = 0.7
    values[..., 8] = 1
    values[..., 0:3] = values[..., 3:6] * random.exponential(1, (height, width, samples, 1))
    return values, values[:, :, 0, 3:6].copy()

"""A progressive path tracer whose adaptive sampling is coupled to its denoiser.

Images are arrays of shape (height, width, 3), maps of shape (height, width), both float32; rows from the top, linear RGB.

Exceptions say what was found and what is accepted: ``ValueError`` and ``TypeError`` for arguments, ``OSError`` for the file
system, ``MemoryError`` before more memory is taken than there is, :class:`Error` for files with wrong content.
"""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Final, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Denoised",
    "Error",
    "Estimate",
    "Pass",
    "Render",
    "Scene",
    "Store",
    "allocate",
    "compare",
    "denoise",
    "denoisers",
    "merge",
    "priority",
    "read_image",
    "render",
    "use_weights",
    "write_image",
]

class Error(Exception):
    """A scene, an image or a state whose content is wrong."""

@final
class Scene:
    """A scene, which does not change. Its acceleration structure is built by the first render. Ctrl-C is not heard while a scene
    is loaded or its acceleration structure is built."""

    @staticmethod
    def load(
        path: str | PathLike[str],
        *,
        resolution: tuple[int, int] | None = None,
        pixel_bounds: tuple[int, int, int, int] | None = None,
        max_depth: int | None = None,
    ) -> Scene:
        """Reads a scene in the format of pbrt-v2, v3 or v4.

        ``resolution``: width and height of the film in pixels in place of the scene's. ``pixel_bounds``: the part of the film
        to render, x0, x1, y0, y1 in pixels, half open. ``max_depth``: the largest number of scattering events of a path in
        place of the scene's.

        Raises ``OSError`` if the file cannot be read, :class:`Error` with file and line if the scene is wrong or does not fit in
        memory.
        """

    @staticmethod
    def parse(
        text: str,
        folder: str | PathLike[str] = ...,
        *,
        resolution: tuple[int, int] | None = None,
        pixel_bounds: tuple[int, int, int, int] | None = None,
        max_depth: int | None = None,
    ) -> Scene:
        """Reads a scene from a text; file names in it are relative to ``folder``, by default the current one. Otherwise as :meth:`load`."""

    @property
    def width(self) -> int:
        """Width of the rendered image in pixels."""
    @property
    def height(self) -> int:
        """Height of the rendered image in pixels."""
    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height of the whole film in pixels."""
    @property
    def pixel_bounds(self) -> tuple[int, int, int, int]:
        """The part of the film that is rendered: x0, x1, y0, y1 in pixels, half open."""
    @property
    def max_depth(self) -> int:
        """The largest number of scattering events of a path."""
    @property
    def spp(self) -> int:
        """Samples per pixel that the scene asks for."""
    @property
    def effects(self) -> list[str]:
        """Names of the effects that the scene calls for, such as ``depth-of-field`` and ``motion-blur``."""
    @property
    def dimensions(self) -> list[str]:
        """Names of the dimensions of a sample, such as ``R`` and ``N1.x``. They follow from the effects."""
    @property
    def warnings(self) -> list[str]:
        """Warnings of the reader, one line each."""

    def store(self, *, reservoir: int = 0, seed: int = 0) -> Store:
        """Returns an empty store for samples of this scene. See :class:`Store` for the arguments."""

    def render(self, store: Store, counts: int | ArrayLike) -> None:
        """Renders more samples into a store.

        ``counts``: samples of every pixel, or an integer array of shape (height, width). The sample sequence of each pixel
        goes on where it stands, so the result does not depend on how samples are divided among calls. Ctrl-C is heard
        between steps of about 130 000 samples; the store then has the samples of the steps before it.

        Raises ``ValueError`` for a store whose samples are of another scene or view.
        """

@final
class Store:
    """Statistics of the samples of every pixel: Welford moments of all samples and of two independent halves, those of even
    and those of odd index, and a reservoir of whole sample vectors.

    Threads may use one store: calls that add samples wait for each other, and a filter pass sees the samples that were there
    when it began."""

    def __new__(
        cls, width: int, height: int, dimensions: Sequence[str], *, reservoir: int = 0, seed: int = 0
    ) -> Store:
        """Creates an empty store for samples of any renderer.

        ``dimensions``: the names of the columns of the samples to be pushed, in any order. ``R``, ``G`` and ``B`` are required
        (linear radiance, not negative). Features improve the image: ``albedo.r/g/b`` in [0, 1], unit normals ``N1.x/y/z`` of
        the first hit and ``N2.x/y/z`` of the second, positions ``P1.x/y/z`` and ``P2.x/y/z`` in units of the scene's
        diameter. Random parameters in [0, 1) are read by ``prpf`` and ``rpf``: ``lens.u/v``, ``time``, ``light1.u/v``,
        ``bsdf1.u/v``. ``film.x`` and ``film.y`` are the film position in pixels, the pixel's centre by default.
        ``radiance.r/g/b``, ``emission.r/g/b`` and ``hit`` are auxiliary. The names of a group are given together.

        ``reservoir``: sample vectors that are kept of each pixel; ``prpf`` needs 8. ``seed``: of renders into the store, of the
        reservoir and of filters.
        """

    @staticmethod
    def from_moments(
        dimensions: Sequence[str], counts: ArrayLike, means: ArrayLike, variances: ArrayLike, *, seed: int = 0
    ) -> Store:
        """Creates a store of buffers that a renderer has reduced its samples to.

        The first axis of each buffer is that of two independent halves of the samples. ``counts``: integers of shape
        (2, height, width). ``means`` and ``variances``: real numbers of shape (2, height, width, columns); variances are
        unbiased and of the samples, not of their mean. There are no sample vectors, so ``prpf`` and ``rpf`` cannot filter it.
        """

    @staticmethod
    def load(path: str | PathLike[str]) -> Store:
        """Reads the store of a render state, as :func:`render` and ``prpf render --state`` write it. :meth:`Scene.render` goes on
        from one of the same scene and view, but not from that of a shard, some of whose samples it would take again."""

    @property
    def width(self) -> int:
        """In pixels."""
    @property
    def height(self) -> int:
        """In pixels."""
    @property
    def dimensions(self) -> list[str]:
        """Names of the dimensions, in the order of the last axis of :meth:`mean`."""
    @property
    def reservoir(self) -> int:
        """Sample vectors that are kept of each pixel at most."""
    @property
    def seed(self) -> int:
        """The seed of the store's samples; of a merged store, that of the first state."""
    @property
    def samples(self) -> int:
        """Valid samples of the whole image."""
    @property
    def rejected(self) -> int:
        """Samples that are in no statistic because a value was not finite or above 1e15, or a radiance negative."""
    @property
    def spp(self) -> float:
        """Valid samples per pixel, on average."""

    def push(self, samples: ArrayLike, *, x: int = 0, y: int = 0) -> None:
        """Adds the samples of a rectangle of pixels with its upper left corner at (x, y).

        ``samples``: real numbers of shape (height, width, samples, columns), or (height, width, columns) for one sample of each
        pixel; the columns are the dimensions that the store was created with. Samples must be independent. One that is not
        finite is counted in :attr:`rejected`.
        """

    def push_pixels(self, pixels: ArrayLike, samples: ArrayLike) -> None:
        """Adds samples in any order: an x and a y in each row of ``pixels``, the values in the same row of ``samples``."""

    def counts(self, half: Literal[0, 1] | None = None) -> NDArray[np.uint32]:
        """Returns the valid samples of each pixel, of all or of a half: shape (height, width)."""

    def mean(
        self, names: str | Sequence[str] | None = None, *, half: Literal[0, 1] | None = None
    ) -> NDArray[np.float32]:
        """Returns means of the samples: shape (height, width, dimensions); 0 in pixels without samples.

        ``names``: dimensions such as ``N1.x``, groups such as ``N1``, or ``RGB``; all by default. ``half``: of half the samples.
        """

    def variance(
        self, names: str | Sequence[str] | None = None, *, half: Literal[0, 1] | None = None
    ) -> NDArray[np.float32]:
        """Returns unbiased variances of the samples; 0 in pixels with fewer than two. Divided by the counts, they are the
        variances of the mean. Arguments and shape as of :meth:`mean`."""

    def deviation(
        self, names: str | Sequence[str] | None = None, *, half: Literal[0, 1] | None = None
    ) -> NDArray[np.float32]:
        """Returns standard deviations of the samples, the roots of :meth:`variance`."""

@final
class Denoised:
    """An image and its maps."""

    made_by: Final[str]
    """The denoiser; another than asked for if the store has fewer samples than pixels, or in a render if time is short."""
    image: Final[NDArray[np.float32]]
    """Linear RGB, directly visible emission included."""
    halves: Final[tuple[NDArray[np.float32], NDArray[np.float32]]]
    """The image as each half of the samples gives it."""
    variance: Final[NDArray[np.float32]]
    """Estimated variance of the image, squared radiance: (height, width, 3)."""
    error: Final[NDArray[np.float32]]
    """Estimated squared error, mean of channels, squared radiance: (height, width)."""
    residual: Final[NDArray[np.float32]]
    """Squared difference from the unfiltered image over its expected value, about 1 where the filter is unbiased:
    (height, width)."""
    risk: Final[NDArray[np.float32]]
    """Unbiased, noisy estimate of the squared error: (height, width, 3)."""
    interpolation_failure: Final[NDArray[np.float32] | None]
    """1 where interpolation of feature weights failed: (height, width). ``None`` of a denoiser that does not interpolate."""
    estimate: Final[Estimate | None]
    """The estimated error of the image; ``None`` if too few pixels have samples in both halves, or if squares of pixels were
    filtered because samples or time were short."""
    seconds: Final[float]
    """Seconds of the filter pass."""

@final
class Estimate:
    """The estimated relMSE of an image."""

    relmse: Final[float]
    low: Final[float]
    """Lower end of the 95 % interval."""
    high: Final[float]
    """Upper end of the 95 % interval."""
    tiles: Final[NDArray[np.float32]]
    """relMSE of tiles of 16x16 pixels."""

@final
class Pass:
    """A filter pass of the render loop, as a callback gets it. A store that is kept costs a copy of it."""

    index: Final[int]
    result: Final[Denoised]
    store: Final[Store]

@final
class Render:
    """A finished render."""

    result: Final[Denoised]
    store: Final[Store]
    passes: Final[list[dict[str, Any]]]
    """Records of the filter passes, under the names of the report's keys."""
    stopped_by: Final[str]
    """``spp``, ``time``, ``target-error`` or ``interrupt``."""
    seconds: Final[dict[str, float]]
    """Seconds of the stages ``render``, ``filter``, ``calibrate`` and ``allocate``."""

def denoisers() -> list[str]:
    """Returns the names of all denoisers, the default first."""

def denoise(store: Store, denoiser: str = "learned") -> Denoised:
    """Filters a store with one of :func:`denoisers`. Ctrl-C cancels the pass (that of ``oidn`` after it).

    Raises ``ValueError`` if the store has no samples, or a smaller reservoir than the denoiser needs.
    """

def use_weights(path: str | PathLike[str]) -> None:
    """Filters by other weights of ``learned``, which ``training/export.py`` has written, in the whole process: before the first
    filter pass, and once. :class:`Error` for a file of something else, ``ValueError`` if other weights are in use."""

def priority(
    store: Store,
    result: Denoised,
    *,
    filtered_variance: float | None = None,
    raw_variance: float | None = None,
    interpolation_failure: float | None = None,
    residual: float | None = None,
) -> NDArray[np.float32]:
    """Computes the priority of each pixel from the maps of a result: shape (height, width). Total sample counts should be
    proportional to it. The weights of the maps default to those of ``prpf render``; 0 leaves a map out."""

def allocate(
    store: Store,
    priority: Denoised | ArrayLike,
    samples: int,
    *,
    min_spp: int = 0,
    max_spp: int | None = None,
) -> NDArray[np.uint32]:
    """Computes the sample counts of the next batch: shape (height, width).

    ``priority``: numbers from 0 up of shape (height, width), or a result whose maps give them. Total counts, with the samples
    that the store has, become proportional to it as far as ``samples``, the number of samples of the batch, allow; 15 % of
    them are distributed uniformly, and no pixel gets more than about 8 times the batch's mean. ``min_spp`` and ``max_spp`` are
    bounds of a pixel's total.
    """

def render(
    scene: Scene,
    *,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    sampling: Literal["adaptive", "uniform"] | None = None,
    sample_map: ArrayLike | None = None,
    sample_map_values: Literal["relative", "absolute"] = "relative",
    denoiser: str = "learned",
    seed: int = 0,
    min_spp: int | None = None,
    max_spp: int | None = None,
    reservoir: int = 0,
    statistics: Literal["all", "needed"] | None = None,
    reference: ArrayLike | None = None,
    callback: Callable[[Pass], object] | None = None,
    counts: Callable[[Pass, NDArray[np.uint32]], ArrayLike] | None = None,
    output: str | PathLike[str] | None = None,
    state: str | PathLike[str] | None = None,
    state_every: float = 40.0,
    resume: str | PathLike[str] | None = None,
    samples: str | PathLike[str] | None = None,
) -> Render:
    """Renders, filters and allocates until the first budget is spent.

    ``spp``: samples per pixel on average. ``time``: seconds, the last filter pass and the writing of ``output`` and ``state``
    included. ``target_error``: estimated relMSE. Without any of them the scene's samples per pixel are rendered. ``sampling``:
    adaptive without a map. ``sample_map``: real numbers of shape (height, width) by which samples are placed instead of by the
    denoiser's maps: ratios, or with absolute values the counts themselves, after which the render ends; it must not depend on
    the samples that it places. ``min_spp`` and ``max_spp``: floor and ceiling of a pixel's samples; by default 4, or the
    ceiling if that is lower, and none. ``reference``: an image that every pass is compared with. ``callback`` is called after
    every filter pass, the last one included; if it returns a true value, the render ends with the samples so far. ``counts``
    chooses where samples go: it is called before every batch that follows a pass of this call, with that pass and the counts
    that our rule plans, and returns the counts to take, integers of shape (height, width), at most as many in all as are
    planned. ``statistics``: whether the store keeps every dimension, or only those that the denoiser, an EXR and, with
    ``state``, the denoiser ``learned`` read; this takes less memory and time. By default every one, or those of the state with ``resume``.
    ``output``: an ``.exr`` with all layers or a ``.png``. ``state``: a file for :meth:`Store.load` and ``prpf denoise``,
    ``merge`` and ``render --resume``, which is replaced every ``state_every`` seconds and at the end; while it cannot be
    written, the render goes on with a ``RuntimeWarning``. ``resume``: a state of the same scene, view and seed to go on from,
    which may be the same file; with a budget of samples the image is the same to the last bit as without the interruption.
    ``samples``: an ``.npz`` file for every sample vector of this call, as ``prpf render --samples`` writes it; the store keeps
    every dimension then.

    Ctrl-C ends the render after the current step and one filter pass, and raises ``KeyboardInterrupt``; an exception of
    ``callback`` or ``counts`` ends it in the same way. Before the exception is raised, ``output``, ``state`` and ``samples`` are written with the
    samples so far. For a file that cannot be written an ``OSError`` is raised after all others are written. Such exceptions
    have the :class:`Render` as their attribute ``render``; that of a wrong argument, which ends no render, has none. Of several
    the first is raised, and its ``__cause__`` is the next.
    """

def merge(states: Sequence[str | PathLike[str]], output: str | PathLike[str]) -> Store:
    """Adds the samples of render states of one image with different seeds or shards, writes the sum as a state, and returns its
    store.

    Raises :class:`Error` for a state of another image, or of samples that are there already.
    """

def compare(image: ArrayLike, reference: ArrayLike) -> dict[str, float]:
    """Compares two images by every metric of ``prpf compare``: ``mse``, ``relmse``, ``block_relmse``, ``psnr`` in dB, ``ssim``,
    ``flip``, ``mean_ratio``, and ``excluded_pixels``, the number of pixels that are not finite in one of them."""

def read_image(path: str | PathLike[str]) -> NDArray[np.float32]:
    """Reads an EXR, PNG, JPEG or TGA file in linear light."""

def write_image(path: str | PathLike[str], image: ArrayLike) -> None:
    """Writes an image: ``.exr`` in linear light, ``.png`` in sRGB."""

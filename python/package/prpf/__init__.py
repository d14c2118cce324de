"""The package: all names of the compiled module, which `__init__.pyi` documents."""

from ._prpf import *
from ._prpf import __all__, __doc__

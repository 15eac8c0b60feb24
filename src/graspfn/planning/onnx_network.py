"""The network of a model's folder, run by onnxruntime: three times as fast as by torch, which need not be there."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnxruntime

from graspfn.geometry.grid import SHAPE
from graspfn.imaging.height_map import SHAPE as MAP_SHAPE
from graspfn.learning.folder import WeightsError, check_pointer
from graspfn.planning.model import NETWORK

FATAL = 4  # of onnxruntime's severities: what goes wrong it raises as well, and its warnings are about no fault of ours


class OnnxNetwork:
    """A `Predictor`; threads that call it at once are served at once.

    threads: that one image is spread over. The same number gives the same bits, another the same to 1e-6.
    WeightsError, in one line that names the file, where it is not the one with that sha256.
    """

    def __init__(self, folder: Path, channels: int, sha256: str, threads: int = 1):
        path = folder / NETWORK
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # a robot has other work
        options.log_severity_level = FATAL
        content = _content(path, sha256)
        try:
            self._session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # of a dozen types; an onnxruntime that is older than the file, say
            raise WeightsError(f"{path}: onnxruntime cannot run it: {' '.join(str(error).split())[:200]}") from None
        takes = [given.shape for given in self._session.get_inputs()]
        gives = [given.shape for given in self._session.get_outputs()]
        if takes != [[1, channels, *MAP_SHAPE]] or gives != [[1, *SHAPE]] * 2:
            raise WeightsError(f"{path}: takes {takes} and gives {gives}; not the network in config.json")

    def __call__(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(channels, 132, 176) float32 -> scores (33, 44, 6) float32 and likeliest classes (33, 44, 6) uint8."""
        scores, likeliest = self._session.run(None, {"input": inputs[None]})
        return scores[0], likeliest[0]


def _content(path: Path, sha256: str) -> bytes:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file; `graspfn model export` writes it beside config.json") from None
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read: {error.strerror or error}") from None
    check_pointer(path, content)
    if hashlib.sha256(content).hexdigest() != sha256:
        raise WeightsError(f"{path}: damaged, or of another network than config.json, says the sha256 in it")
    return content

"""Trained CRF layers on disk: safetensors files with a header that says how to build the layer again."""

import json
from pathlib import Path

from semgrid_edu.crf.layer import CrfLayer
from semgrid_edu.crf.params import CrfParams
from semgrid_edu.errors import DataError
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.reading import parse_json
from semgrid_edu.storage.tensors import read_tensors, write_tensors


def save_crf(layer: CrfLayer, path: str | Path) -> None:
    """Write a layer's weights, widths and label costs, atomically.

    Parameters
    ----------
    layer : CrfLayer
        The layer.
    path : path-like
        The safetensors file to write.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in layer.state_dict().items()}
    write_tensors(path, tensors, {"crf": json.dumps(layer.description())})


def load_crf(path: str | Path) -> CrfLayer:
    """Read a trained CRF.

    Parameters
    ----------
    path : path-like
        A file that `save_crf` wrote.

    Returns
    -------
    CrfLayer
        The layer.

    Raises
    ------
    DataError
        When the file is missing, damaged or of another program.
    """
    header, tensors = read_tensors(path)
    try:
        description = parse_json(path, header["crf"])
        start = CrfParams(normalization=description.pop("normalization"))
        layer = CrfLayer(start, **description)
    except (KeyError, TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise DataError(path, "the description of a CRF in the header", f"{header}: {error}") from error
    check_tensors(path, tensors, layer.state_dict())
    layer.load_state_dict(tensors)
    return layer

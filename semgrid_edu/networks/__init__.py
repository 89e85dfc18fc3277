"""The networks: i -> s and (p, o) -> g, each by itself and joined (paper, sections 3.1 and 3.4)."""

from semgrid_edu.networks.build import SEGMENTERS, Architecture, build_net, build_segmenter
from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.fusion import FusionNet
from semgrid_edu.networks.segnet import SegNet
from semgrid_edu.networks.semantic_grid import SemanticGridNet, Stages
from semgrid_edu.networks.weights import load_net, save_net

__all__ = [
    "SEGMENTERS",
    "Architecture",
    "ConvDeconv",
    "FusionNet",
    "SegNet",
    "SemanticGridNet",
    "Stages",
    "build_net",
    "build_segmenter",
    "load_net",
    "save_net",
]

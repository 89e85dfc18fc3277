"""The networks: i -> s and (p, o) -> g, separately and end to end (paper, sections 3.1 and 3.4)."""

from semgrid_edu.networks.build import build_net, with_mean_scores
from semgrid_edu.networks.conv_deconv import SegNet
from semgrid_edu.networks.deeplab import DeepLab
from semgrid_edu.networks.efficientnet import EfficientNet
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.networks.fusion import FusionNet
from semgrid_edu.networks.imagenet import load_imagenet
from semgrid_edu.networks.registry import SEGMENTERS, build_segmenter
from semgrid_edu.networks.returns_fusion import ReturnsFusion
from semgrid_edu.networks.segmenter import Segmenter, unit_image
from semgrid_edu.networks.semantic_grid import Architecture, SemanticGridNet
from semgrid_edu.networks.weights import IMAGE_STAGE, WEIGHTS, load_net, save_net

__all__ = [
    "IMAGE_STAGE",
    "SEGMENTERS",
    "WEIGHTS",
    "Architecture",
    "DeepLab",
    "EfficientNet",
    "Fcn",
    "FusionNet",
    "ReturnsFusion",
    "SegNet",
    "Segmenter",
    "SemanticGridNet",
    "build_net",
    "build_segmenter",
    "load_imagenet",
    "load_net",
    "save_net",
    "unit_image",
    "with_mean_scores",
]

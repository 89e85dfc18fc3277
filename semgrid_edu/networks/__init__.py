"""The networks: i -> s and (p, o) -> g, each by itself and joined (paper, sections 3.1 and 3.4)."""

from semgrid_edu.networks.architecture import Architecture
from semgrid_edu.networks.build import build_net
from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.deeplab import DeepLab
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.networks.fusion import FusionNet
from semgrid_edu.networks.image import unit_image
from semgrid_edu.networks.imagenet import load_imagenet
from semgrid_edu.networks.registry import SEGMENTERS, build_segmenter
from semgrid_edu.networks.resnet import ResNet
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.segnet import SegNet
from semgrid_edu.networks.semantic_grid import NetOutputs, SemanticGridNet
from semgrid_edu.networks.unet import UNet
from semgrid_edu.networks.vgg import Vgg
from semgrid_edu.networks.weights import IMAGE_STAGE, WEIGHTS, load_net, save_net

__all__ = [
    "IMAGE_STAGE",
    "SEGMENTERS",
    "WEIGHTS",
    "Architecture",
    "ConvDeconv",
    "DeepLab",
    "Fcn",
    "FusionNet",
    "NetOutputs",
    "ResNet",
    "SegNet",
    "Segmenter",
    "SemanticGridNet",
    "UNet",
    "Vgg",
    "build_net",
    "build_segmenter",
    "load_imagenet",
    "load_net",
    "save_net",
    "unit_image",
]

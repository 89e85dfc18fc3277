"""The image networks, i -> s (section 3.1): SegNet, FCN, DeepLab and U-Net, and the registry that names them."""

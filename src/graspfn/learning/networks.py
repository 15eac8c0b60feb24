"""The networks: depth image (B, 1, 132, 176) or height map (B, 2, 132, 176) -> logits (B, 33, 44, 6, 6), the last
axis a score class.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from graspfn.geometry.grid import CELL_RAD, SHAPE
from graspfn.learning.targets import CLASSES
from graspfn.params import AlexNet as AlexNetParams
from graspfn.params import Network
from graspfn.seeds import seed_of

N_V, N_U, N_THETA = SHAPE
FINER = 4  # pixels of the input to a cell of Q
SIDE = 128  # px of a turned input: 32 cm, the diagonal of the largest object and some table around
LOW = 0.05  # height in the input's units that counts as the object, 5 mm
BEYOND = 0.02  # share of the object's pixels that may lie beyond each end


class GraspNetwork(nn.Module):
    """What every architecture offers: logits for the grasp function, and features for telling objects apart."""

    n_features: int

    def features(self, x: torch.Tensor) -> torch.Tensor:
        """(B, channels, 132, 176) -> (B, n_features), of the layers that pre-training shares with grasping."""
        raise NotImplementedError

    def prior_bias(self) -> torch.Tensor:
        """Bias of the output layer, as a view (..., 6) with one entry per score class."""
        raise NotImplementedError

    def set_prior(self, frequencies: np.ndarray) -> None:
        """Start from predicting the classes' frequencies (6,) everywhere.

        Nearly all poses miss the object: without this the first steps learn nothing but that.
        """
        with torch.no_grad():
            log_prior = np.log(np.maximum(frequencies, 1e-4))
            self.prior_bias().copy_(torch.as_tensor(log_prior - log_prior.mean(), dtype=torch.float32))


class AlexNet(GraspNetwork):
    """The paper's: five convolutions with max pooling and two fully-connected layers, the last of 8712 x 6 outputs."""

    def __init__(self, channels: int, width: int, hidden: int, dropout: float):
        super().__init__()

        def convolution(inputs: int, outputs: int, size: int, stride: int = 1) -> list[nn.Module]:
            return [nn.Conv2d(inputs, outputs, size, stride, padding=size // 2), nn.ReLU(inplace=True)]

        self.trunk = nn.Sequential(
            *convolution(channels, width, 7, stride=2),
            nn.MaxPool2d(2),  # 33 x 44
            *convolution(width, 2 * width, 5),
            nn.MaxPool2d(2),  # 16 x 22
            *convolution(2 * width, 4 * width, 3),
            *convolution(4 * width, 4 * width, 3),
            *convolution(4 * width, 4 * width, 3),
            nn.MaxPool2d(2),  # 8 x 11
            nn.Flatten(),
        )
        self.hidden = nn.Sequential(
            nn.Dropout(dropout), nn.Linear(4 * width * 8 * 11, hidden), nn.ReLU(inplace=True), nn.Dropout(dropout)
        )
        self.output = nn.Linear(hidden, int(np.prod(SHAPE)) * CLASSES)
        self.n_features = hidden
        for layer in (*self.trunk, *self.hidden):
            if isinstance(layer, nn.Conv2d | nn.Linear):  # torch's own draw fades out over six layers of ReLU
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
                assert layer.bias is not None
                nn.init.zeros_(layer.bias)

    def features(self, x: torch.Tensor) -> torch.Tensor:
        return self.hidden(self.trunk(x))

    def prior_bias(self) -> torch.Tensor:
        return self.output.bias.view(*SHAPE, CLASSES)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.output(self.features(x)).view(-1, *SHAPE, CLASSES)


def _block(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, padding=size // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class FCN(GraspNetwork):
    """Fully convolutional: the same weights for every position, as a grasp succeeds alike wherever the object lies.

    One output cell is four input pixels a side. Two further halvings let it see the whole object (a cell sees 16 cm
    each way) before the detail comes back through the skips.
    """

    def __init__(self, channels: int, width: int, angles: int = SHAPE[2]):
        super().__init__()
        self.stem = nn.Sequential(_block(channels, width, 5, stride=2), _block(width, 2 * width, 3, stride=2))
        self.level0 = _block(2 * width, 2 * width)  # 33 x 44
        self.level1 = nn.Sequential(_block(2 * width, 4 * width, stride=2), _block(4 * width, 4 * width))  # 17 x 22
        self.level2 = nn.Sequential(  # 9 x 11
            _block(4 * width, 8 * width, stride=2), _block(8 * width, 8 * width), _block(8 * width, 8 * width)
        )
        self.up1 = _block(12 * width, 4 * width)
        self.up0 = nn.Sequential(_block(6 * width, 4 * width), _block(4 * width, 4 * width))
        self.output = nn.Conv2d(4 * width, angles * CLASSES, 1)
        self.n_features = 8 * width

    def _map(self, x: torch.Tensor) -> torch.Tensor:
        """(B, 4 width, 33, 44), before the output layer."""
        x0 = self.level0(self.stem(x))
        x1 = self.level1(x0)
        x2 = self.level2(x1)
        x1 = self.up1(torch.cat([x1, functional.interpolate(x2, size=x1.shape[-2:])], dim=1))
        return self.up0(torch.cat([x0, functional.interpolate(x1, size=x0.shape[-2:])], dim=1))

    def features(self, x: torch.Tensor) -> torch.Tensor:
        seen = self._map(x)
        return torch.cat([seen.mean(dim=(-2, -1)), seen.amax(dim=(-2, -1))], dim=1)

    def prior_bias(self) -> torch.Tensor:
        assert self.output.bias is not None
        return self.output.bias.view(-1, CLASSES)

    def maps(self, x: torch.Tensor) -> torch.Tensor:
        """(B, channels, 4 h, 4 w) -> logits (B, angles * 6, h, w)."""
        return self.output(self._map(x))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        logits = self.maps(x)
        return logits.view(-1, SHAPE[2], CLASSES, *SHAPE[:2]).permute(0, 3, 4, 1, 2)


class TurnedFCN(GraspNetwork):
    """One angle is learned, and the input is turned to each of the six. channels: of a height map, heights first.

    A gripper does not care how an object is turned on the table: when it turns by 30 degrees, so does its grasp
    function, and moves on by one angle. Networks that learn each angle by itself have to find that out from samples.

    The input is turned about the middle of the object, cut out there, given to an FCN of a single angle, whose output
    is turned back. Poses beyond what was cut out get logits of their own, which are learned: nothing is there to hold.
    """

    cos: torch.Tensor
    sin: torch.Tensor

    def __init__(self, channels: int, width: int):
        super().__init__()
        self.one = FCN(channels, width, angles=1)
        self.beyond = nn.Parameter(torch.zeros(CLASSES))
        self.n_features = self.one.n_features
        theta = torch.arange(N_THETA) * CELL_RAD
        self.register_buffer("cos", theta.cos(), persistent=False)
        self.register_buffer("sin", theta.sin(), persistent=False)

    def prior_bias(self) -> torch.Tensor:
        return self.one.prior_bias()

    def features(self, x: torch.Tensor) -> torch.Tensor:
        return self.one.features(self._turned(x, middle(x))).view(-1, N_THETA, self.n_features).mean(dim=1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        at = middle(x)
        return self._turned_back(self.one.maps(self._turned(x, at)), at)

    def _turned(self, x: torch.Tensor, at: torch.Tensor) -> torch.Tensor:
        """(6 B, channels, SIDE, SIDE): columns along the closing direction of each angle, 0 where nothing was seen."""
        along = torch.arange(SIDE, device=x.device, dtype=x.dtype) - (SIDE - 1) / 2
        c, s = self.cos.view(-1, 1, 1), self.sin.view(-1, 1, 1)
        u = at[:, 0].view(-1, 1, 1, 1) + c * along[None, :] - s * along[:, None]
        v = at[:, 1].view(-1, 1, 1, 1) + s * along[None, :] + c * along[:, None]
        places = torch.stack([u * (2 / x.shape[3]), v * (2 / x.shape[2])], dim=-1).view(-1, SIDE, SIDE, 2)
        each = x[:, None].expand(-1, N_THETA, -1, -1, -1).reshape(-1, *x.shape[1:])
        return functional.grid_sample(each, places, align_corners=False)

    def _turned_back(self, logits: torch.Tensor, at: torch.Tensor) -> torch.Tensor:
        """(6 B, 6, SIDE / 4, SIDE / 4) -> (B, 33, 44, 6, 6)."""
        u, v = (torch.arange(n, device=at.device, dtype=at.dtype) - (n - 1) / 2 for n in (N_U, N_V))
        u = (u - at[:, :1] / FINER).view(-1, 1, 1, N_U)
        v = (v - at[:, 1:] / FINER).view(-1, 1, N_V, 1)
        c, s = self.cos.view(-1, 1, 1), self.sin.view(-1, 1, 1)
        places = torch.stack([c * u + s * v, c * v - s * u], dim=-1).view(-1, N_V, N_U, 2) * (2 * FINER / SIDE)
        beyond = (self.prior_bias() + self.beyond).view(1, CLASSES, 1, 1)
        back = functional.grid_sample(logits - beyond, places, align_corners=False) + beyond
        return back.view(-1, N_THETA, CLASSES, N_V, N_U).permute(0, 3, 4, 1, 2)


def middle(x: torch.Tensor) -> torch.Tensor:
    """(B, 2) of the object along u and v, px from the input's centre: between its outermost pixels, but for a few.

    x: (B, channels, 132, 176), heights first. The centre itself where there is no object.
    """
    object_ = (x[:, 0] > LOW).to(x.dtype)
    ends = []
    for across in (1, 2):
        count = object_.sum(dim=across).cumsum(dim=1)
        total = count[:, -1:]
        low = (count <= BEYOND * total).to(x.dtype).sum(dim=1)
        high = (count < (1 - BEYOND) * total).to(x.dtype).sum(dim=1)
        found = (low + high) / 2 - (count.shape[1] - 1) / 2
        ends.append(torch.where(total[:, 0] > 0, found, torch.zeros_like(found)))
    return torch.stack(ends, dim=1)


class Classifier(nn.Module):
    """A network's features and one linear layer on them: (B, channels, 132, 176) -> logits (B, classes)."""

    def __init__(self, network: GraspNetwork, classes: int):
        super().__init__()
        self.network = network
        self.head = nn.Linear(network.n_features, classes)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.head(self.network.features(x))


def build_network(params: Network, seed: int = 0) -> GraspNetwork:
    """An untrained network; its weights are drawn from the seed."""
    with torch.random.fork_rng():
        torch.manual_seed(seed_of(seed, "weights", params.architecture))
        if isinstance(params, AlexNetParams):
            return AlexNet(params.channels, params.width, params.hidden, params.dropout)
        if params.architecture == "turned":
            return TurnedFCN(params.channels, params.width)
        return FCN(params.channels, params.width)

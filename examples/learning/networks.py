"""Three small networks: ResNet-18 (He et al. 2016), PointNet (Qi et al. 2017) and U-Net (Ronneberger et al. 2015).

ResNet-18 is written out because torchvision has to be built for the same torch; its weights would be of photographs anyway.
"""

from pytorch import torch
from torch import nn


def _norm(made: nn.Module, channels: int, *then: nn.Module) -> nn.Sequential:
    return nn.Sequential(made, nn.BatchNorm2d(channels), *then)


class Residual(nn.Module):
    """Two 3 x 3 convolutions, and the input added to what they make."""

    def __init__(self, n_in: int, n_out: int, stride: int) -> None:
        super().__init__()
        self.first = _norm(nn.Conv2d(n_in, n_out, 3, stride, 1, bias=False), n_out, nn.ReLU())
        self.second = _norm(nn.Conv2d(n_out, n_out, 3, 1, 1, bias=False), n_out)
        same = n_in == n_out and stride == 1
        self.shortcut = nn.Identity() if same else _norm(nn.Conv2d(n_in, n_out, 1, stride, bias=False), n_out)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(self.second(self.first(x)) + self.shortcut(x))


class ResNet18(nn.Module):
    """Crops (n, channel, row, col), and numbers (n, extra) that join before the last layer, to logits (n, class).

    The original has 64 channels in its first stage; a `width` of 16 costs a ninth of the time on a processor.
    """

    def __init__(self, classes: int, channels: int = 3, extra: int = 0, width: int = 64) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            _norm(nn.Conv2d(channels, width, 7, 2, 3, bias=False), width, nn.ReLU()), nn.MaxPool2d(3, 2, 1)
        )
        widths = [(width, width, 1), *((width << k, width << k + 1, 2) for k in range(3))]
        self.stages = nn.ModuleList(nn.Sequential(Residual(a, b, s), Residual(b, b, 1)) for a, b, s in widths)
        self.last = nn.Linear(8 * width + extra, classes)

    def forward(self, x: torch.Tensor, extra: torch.Tensor | None = None) -> torch.Tensor:
        x = self.stem(x)
        for stage in self.stages:
            x = stage(x)
        x = x.mean(dim=(2, 3))
        return self.last(x if extra is None else torch.cat([x, extra], dim=1))


class PointNet(nn.Module):
    """Points (n, point, feature) to outputs (n, out): one network on every point, the maximum, another on that."""

    def __init__(self, features: int, outputs: int, width: int = 256) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for a, b in ((features, 64), (64, 128), (128, width)):
            layers += [nn.Conv1d(a, b, 1, bias=False), nn.BatchNorm1d(b), nn.ReLU()]
        self.each = nn.Sequential(*layers)
        self.whole = nn.Sequential(
            nn.Linear(width, 256), nn.BatchNorm1d(256), nn.ReLU(), nn.Dropout(0.2),
            nn.Linear(256, 128), nn.BatchNorm1d(128), nn.ReLU(), nn.Linear(128, outputs),
        )  # fmt: skip

    def forward(self, points: torch.Tensor) -> torch.Tensor:
        return self.whole(self.each(points.transpose(1, 2)).amax(dim=2))


class UNet(nn.Module):
    """Crops (n, channel, row, col) to maps (n, out, row, col) of the same size, a multiple of 8."""

    def __init__(self, channels: int, outputs: int, width: int = 16) -> None:
        super().__init__()
        wide = [width, 2 * width, 4 * width, 8 * width]
        self.down = nn.ModuleList(self._pair(a, b) for a, b in zip([channels, *wide], wide, strict=False))
        self.raise_ = nn.ModuleList(nn.ConvTranspose2d(2 * a, a, 2, 2) for a in reversed(wide[:-1]))
        self.up = nn.ModuleList(self._pair(2 * a, a) for a in reversed(wide[:-1]))
        self.last = nn.Conv2d(width, outputs, 1)

    @staticmethod
    def _pair(n_in: int, n_out: int) -> nn.Sequential:
        return nn.Sequential(
            _norm(nn.Conv2d(n_in, n_out, 3, 1, 1, bias=False), n_out, nn.ReLU()),
            _norm(nn.Conv2d(n_out, n_out, 3, 1, 1, bias=False), n_out, nn.ReLU()),
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        kept = []
        for k, pair in enumerate(self.down):
            x = pair(x if k == 0 else torch.max_pool2d(x, 2))
            kept.append(x)
        for lift, pair, beside in zip(self.raise_, self.up, reversed(kept[:-1]), strict=True):
            x = pair(torch.cat([lift(x), beside], dim=1))
        return self.last(x)

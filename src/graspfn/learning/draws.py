"""Random numbers by counting: the i-th of a name and a seed is a function of these three alone.

Thousands of samples draw at once, on any device, and each draws what it would draw alone: torch's own generators give
numbers that depend on the batch, and on the device.
"""

from __future__ import annotations

import math

import torch

from graspfn.seeds import seed_of


def _signed(value: int) -> int:
    """The int64 of the same 64 bits."""
    return (value + 2**63) % 2**64 - 2**63


GOLDEN, FIRST, SECOND = (_signed(c) for c in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


def _mix(z: torch.Tensor) -> torch.Tensor:
    """SplitMix64's finaliser (Steele, Lea, Flood 2014), int64 -> int64; the masks make the shifts logical."""
    z = (z ^ ((z >> 30) & (2**34 - 1))) * FIRST
    z = (z ^ ((z >> 27) & (2**37 - 1))) * SECOND
    return z ^ ((z >> 31) & (2**33 - 1))


def bits(seeds: torch.Tensor, name: str, count: int) -> torch.Tensor:
    """(B, count) int64, 64 random bits each, of seeds (B,) int64."""
    start = _mix(_mix(seeds * GOLDEN) ^ _signed(seed_of(name)))
    places = torch.arange(count, dtype=torch.int64, device=seeds.device) * GOLDEN
    return _mix(start[:, None] + places)


def uniform(seeds: torch.Tensor, name: str, *shape: int) -> torch.Tensor:
    """(B, *shape) float64 in [0, 1), one draw of 53 bits each; for the few numbers that rule a whole sample."""
    drawn = (bits(seeds, name, math.prod(shape)) >> 11) & (2**53 - 1)
    return drawn.reshape(-1, *shape).double() * 2.0**-53


def normal(seeds: torch.Tensor, name: str, *shape: int) -> torch.Tensor:
    """(B, *shape) float64 from N(0, 1), as `uniform`."""
    return torch.special.ndtri(uniform(seeds, name, *shape).clamp(min=2.0**-54))


def uniform4(seeds: torch.Tensor, name: str, *shape: int) -> torch.Tensor:
    """(B, 4, *shape) float32 inside (0, 1), of 16 bits each: fine enough for what befalls one cell, and quick."""
    quarters = bits(seeds, name, math.prod(shape)).view(torch.int16)
    return quarters.to(torch.float32).add_(32768.5).mul_(2.0**-16).view(-1, 4, *shape)


def normal4(seeds: torch.Tensor, name: str, *shape: int) -> torch.Tensor:
    """(B, 4, *shape) float32 from N(0, 1), within 4.8, as `uniform4`, by Box and Muller."""
    drawn = uniform4(seeds, name, *shape)
    radius, angle = drawn[:, :2].log().mul_(-2).sqrt_(), drawn[:, 2:] * (2 * math.pi)
    return torch.cat([radius * angle.cos(), radius * angle.sin_()], dim=1)


def triangular4(seeds: torch.Tensor, name: str, *shape: int) -> torch.Tensor:
    """(B, 4, *shape) float32 of mean 0 and std 1, within 2.5, the sum of two draws of 8 bits: ten times as quick."""
    eighths = bits(seeds, name, math.prod(shape)).view(torch.int8).view(-1, 2, 4, *shape)
    both = eighths[:, 0].to(torch.float32).add_(eighths[:, 1])
    return both.add_(1).mul_((6 / (256**2 - 1)) ** 0.5)

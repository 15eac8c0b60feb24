"""The motions of an augmentation table, as tensors: where what is now here was before."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd
import torch


@dataclass(frozen=True)
class Motions:
    """shifts (B, 2) in (u, v) metres and theta (B,) of `T_world_scene`, float64; then mirrored (B,), v becoming -v.

    empty (B,): the object is taken away. All on the CPU: few numbers, in double precision.
    """

    shifts: torch.Tensor
    theta: torch.Tensor
    mirrored: torch.Tensor
    empty: torch.Tensor

    @classmethod
    def of(cls, table: pd.DataFrame) -> Motions:
        shifts = torch.tensor(table[["shift_u_m", "shift_v_m"]].to_numpy(dtype=float))
        theta = torch.tensor(table["theta_rad"].to_numpy(dtype=float))
        mirrored, empty = (torch.tensor(table[name].to_numpy(dtype=bool)) for name in ("mirrored", "empty"))
        return cls(shifts, theta, mirrored, empty)

    def __getitem__(self, indices: list[int]) -> Motions:
        return Motions(self.shifts[indices], self.theta[indices], self.mirrored[indices], self.empty[indices])

    def finish(self, moved: torch.Tensor, mirrored: torch.Tensor) -> torch.Tensor:
        """moved (B, ...), what has been turned and shifted; in mirrored lines `mirrored`, in empty ones 0."""
        mirror, there = (
            part.to(moved.device).view(-1, *[1] * (moved.dim() - 1)) for part in (self.mirrored, ~self.empty)
        )
        return torch.where(mirror, mirrored, moved) * there

    def origins(self, u: torch.Tensor, v: torch.Tensor, unit_m: float) -> tuple[torch.Tensor, torch.Tensor]:
        """(B, h, w) float32 each: where points (u, v), broadcast to ([B,] h, w), were before; all in units of unit_m.

        Of the turn and the shift: the mirror comes after them.
        """
        c, s = self.theta.cos(), self.theta.sin()
        du, dv = (self.shifts / unit_m).unbind(-1)
        c, s, u0, v0 = (
            part.to(u.device, torch.float32)[:, None, None] for part in (c, s, c * du + s * dv, c * dv - s * du)
        )
        return u * c + v * s - u0, v * c - u * s - v0

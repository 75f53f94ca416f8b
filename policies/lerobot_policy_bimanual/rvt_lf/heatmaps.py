"""RVT's translation: one heatmap per view, and the voxel on which the views agree best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor

from lerobot_policy_bimanual.nn.prediction import VoxelCandidates, neighbours
from lerobot_policy_bimanual.rvt_lf.views import images_of_planes, pixels_of_voxels, sum_over_views

CUT_SIGMAS = 3
"""Radius at which the target of a heatmap ends, in standard deviations (RVT code)."""

CHUNK_VOXELS = 2**18
"""Voxels scored at a time, so that they stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class HeatmapTranslation:
    """One softmax over the pixels of each view, as in RVT.

    A voxel's probability is taken to be proportional to the mean of the five heatmaps at the pixels in which it is seen.

    Attributes:
        logits: (b, arms, views, v, v) float32; the pixels are those of `VIEWS`, one per row of voxels.
        sigma_px: standard deviation of the training target.
    """

    logits: Tensor
    sigma_px: float

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Cross-entropy (b, arms) in nats of a small Gaussian around the target positions, voxels and offsets (b, arms, 3).

        Averaged over the views. The Gaussian is cut off at `CUT_SIGMAS` and at the image's border, and then
        normalised; if no pixel is left, as for a target outside the image, the target voxel's pixel is used. The
        Gaussian's entropy is subtracted, so that a perfect heatmap has the loss 0.
        """
        V = self.logits.shape[-1]
        reach = int(CUT_SIGMAS * self.sigma_px + 0.5)
        step = torch.arange(-reach, reach + 1, device=voxel.device)
        row_step, column_step = torch.cartesian_prod(step, step).unbind(1)
        rows, columns = (
            pixel[..., None] + shift  # (b, arms, views, window)
            for pixel, shift in zip(pixels_of_voxels(voxel, V), (row_step, column_step), strict=True)
        )
        row, column = pixels_of_voxels(voxel + offset, V)
        squared = (rows - row[..., None]) ** 2 + (columns - column[..., None]) ** 2
        seen = (rows >= 0) & (rows < V) & (columns >= 0) & (columns < V)
        seen &= squared <= (CUT_SIGMAS * self.sigma_px) ** 2
        weight = torch.exp(-squared.to(self.logits) / (2 * self.sigma_px**2)) * seen
        mass = weight.sum(dim=-1, keepdim=True)
        nearest = ((row_step == 0) & (column_step == 0)).to(weight)
        weight = torch.where(mass > 0, weight / mass, nearest)
        flat = self.logits.flatten(3)
        hit = flat.gather(3, rows.clamp(0, V - 1) * V + columns.clamp(0, V - 1))
        wanted = weight.xlogy(weight).sum(dim=3)
        return (flat.logsumexp(dim=3) - (weight * hit).sum(dim=3) + wanted).mean(dim=2)

    def candidates(self) -> VoxelCandidates:
        """The most probable of all voxels and its 26 neighbours."""
        found = _best_and_neighbours(self._planes())
        return replace(found, score=found.score.clamp(min=0).log())

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels."""
        mass = _lattice(self._planes())
        return mass / mass.sum(dim=(2, 3, 4), keepdim=True)

    def pixel_probabilities(self) -> Tensor:
        """The heatmaps, (b, arms, views, v, v)."""
        return self.logits.flatten(3).softmax(dim=3).view_as(self.logits)

    def _planes(self) -> tuple[Tensor, Tensor, Tensor]:
        """Planes xy, xz, yz (b, arms, v, v) whose sum is a voxel's mean probability over the views."""
        return sum_over_views(self.pixel_probabilities() / self.logits.shape[2])


@dataclass(frozen=True, eq=False)
class ProductTranslation:
    """One softmax over all voxels; the logit of a voxel is the sum of the logits of its pixels in all views.

    So a voxel's probability is proportional to the product of the heatmaps, and an uncertain view leaves it to the others.

    Attributes:
        planes: xy, xz, yz (b, arms, v, v) float32, each the sum of the logits of the views that see these two axes.
        sigma_px: standard deviation of the training target.
    """

    planes: tuple[Tensor, Tensor, Tensor]
    sigma_px: float

    @classmethod
    def of_views(cls, logits: Tensor, sigma_px: float) -> Self:
        """That of logits as in `HeatmapTranslation`."""
        return cls(sum_over_views(logits), sigma_px)

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Cross-entropy (b, arms) in nats of a small Gaussian around the target positions, voxels and offsets (b, arms, 3).

        Its own entropy is subtracted, so that a perfect distribution has the loss 0.
        """
        planes = self.planes
        steps = torch.arange(planes[0].shape[-1], device=voxel.device) - (voxel + offset)[..., None]
        wanted = (-(steps**2) / (2 * self.sigma_px**2)).softmax(dim=-1).to(planes[0])  # (b, arms, 3, v)
        x, y, z = wanted.unbind(2)
        hits = zip(planes, (x, x, y), (y, z, z), strict=True)
        hit = sum(torch.einsum("bauv,bau,bav->ba", plane, first, second) for plane, first, second in hits)
        return _lattice(planes).flatten(2).logsumexp(dim=2) - hit + wanted.xlogy(wanted).sum(dim=(2, 3))

    def candidates(self) -> VoxelCandidates:
        """The most probable of all voxels and its 26 neighbours."""
        return _best_and_neighbours(self.planes)

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels."""
        scores = _lattice(self.planes)
        return scores.flatten(2).softmax(dim=2).view_as(scores)

    def pixel_probabilities(self) -> Tensor:
        """Probabilities (b, arms, views, v, v) that a pixel shows the position: those of all voxels that it shows, added up."""
        mass = self.probabilities()
        return images_of_planes(mass.sum(dim=4), mass.sum(dim=3), mass.sum(dim=2))


def _lattice(planes: Sequence[Tensor]) -> Tensor:
    """Sums (b, arms, v, v, v) of planes xy, xz, yz (b, arms, v, v)."""
    xy, xz, yz = planes
    return xy[..., :, :, None] + xz[..., :, None, :] + yz[..., None, :, :]


def _best_and_neighbours(planes: Sequence[Tensor]) -> VoxelCandidates:
    """The voxel at which planes xy, xz, yz (b, arms, v, v) have the largest sum, its 26 neighbours, and their sums."""
    B, A, V, _ = planes[0].shape
    xy, xz, yz = (plane.flatten(0, 1) for plane in planes)
    best = best_voxel(xy, xz, yz)  # (b arms, 3)
    voxel, inside = neighbours(best, V)  # (b arms, 27, 3)
    x, y, z = voxel.clamp(0, V - 1).unbind(2)
    sample = torch.arange(len(best), device=best.device)[:, None]
    score = (xy[sample, x, y] + (xz[sample, x, z] + yz[sample, y, z])).masked_fill(~inside, -torch.inf)
    return VoxelCandidates(voxel.unflatten(0, (B, A)), score.unflatten(0, (B, A)))


def best_voxel(xy: Tensor, xz: Tensor, yz: Tensor) -> Tensor:
    """Voxels (n, 3) with the highest xy[x, y] + (xz[x, z] + yz[y, z]) in planes (n, v, v); the first one of equal ones.

    The maximum over z does not depend on xy, so the lattice is one sum and one maximum per voxel, a few planes of
    constant x at a time.
    """
    n, V, _ = xy.shape
    planes_at_once = max(1, CHUNK_VOXELS // (n * V**2))
    over_z = [(part[:, :, None] + yz[:, None]).amax(dim=3) for part in xz.split(planes_at_once, dim=1)]
    flat = (xy + torch.cat(over_z, dim=1)).flatten(1).argmax(dim=1)
    x, y = flat // V, flat % V
    sample = torch.arange(n, device=xy.device)
    z = (xy[sample, x, y][:, None] + (xz[sample, x] + yz[sample, y])).argmax(dim=1)
    return torch.stack([x, y, z], dim=1)

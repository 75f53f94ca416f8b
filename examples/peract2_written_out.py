"""PerAct and PerAct2 written out step by step, with nothing done cleverly: read this first.

The method is that of Shridhar et al., "Perceiver-Actor", 2022 (https://arxiv.org/abs/2209.05451), for one arm, and of
Grotz et al., "PerAct2", 2024 (https://arxiv.org/abs/2407.00278), for two. A keypose is where a hand goes next. To predict
it is to classify: which voxel, which bin of each Euler angle, gripper open or closed, collisions heeded or ignored. The
steps, with the paper's sizes, in the order of this file:

1. `voxelise` ("Keyframes and Voxelization" in the PerAct paper): the points that the cameras see, averaged in 100^3
   voxels with ten channels.
2. `network` ("PerAct Agent"): a 1x1x1 convolution to 64 channels, the stem; patches of 5^3 voxels, 20^3 of them, each
   joined with proprioception, so that it is a token of 128 numbers; 77 language tokens in front.
3. `trunk`, a Perceiver IO: 2048 latents read the 8077 tokens by cross-attention, pass through 6 blocks of self-attention,
   and answer one query per token. With two arms, PerAct2's step, each arm has half of the latents and its own 6 blocks;
   then one block of self-attention over all latents combines the arms.
4. The rest of `network`, for each arm: the answers for the patches, upsampled to 100^3 and joined with the stem, give one
   logit per voxel. Features pooled from stem, answers and fine map give 3 x 72 logits for the angles, two for the gripper,
   and two for collisions.
5. `one_hot_loss` ("Training Details"): the sum of the cross-entropies of all parts of both arms.

The policies' network (`network.PerActNetwork`) computes the same function faster. Here every arm runs through every layer
on its own, maps are really upsampled and concatenated, attention is two matrix products, and labels are one-hot vectors.
All takes the parameters of a `PerActNetwork` by name, so that the tests compare outputs and gradients.
Shapes: b samples, v voxels per axis, p patches per axis, t tokens.
"""

from collections.abc import Mapping

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

Parameters = Mapping[str, Tensor]


def voxelise(points: Tensor, colours: Tensor, lower: Tensor, upper: Tensor, voxels: int) -> Tensor:
    """Average the points of every voxel, one point and one voxel at a time.

    Args:
        points: (b, 3, n) world positions in metres.
        colours: (b, 3, n) RGB in [-1, 1].
        lower: (3,) corner of the workspace.
        upper: (3,) corner of the workspace.
        voxels: per axis.

    Returns:
        (b, 10, v, v, v): mean position, mean colour, index of the voxel over their number, and whether it is occupied.
    """
    grid = torch.zeros(len(points), 10, voxels, voxels, voxels, dtype=points.dtype)
    for sample in range(len(points)):
        members: dict[tuple[int, ...], list[Tensor]] = {}
        for point, colour in zip(points[sample].T, colours[sample].T, strict=True):
            if bool(((point >= lower) & (point < upper)).all()):
                index = tuple(((point - lower) / ((upper - lower) / voxels)).floor().long().tolist())
                members.setdefault(index, []).append(torch.cat([point, colour]))
        for x in range(voxels):
            for y in range(voxels):
                for z in range(voxels):
                    cell = members.get((x, y, z), [])
                    if cell:
                        grid[sample, :6, x, y, z] = torch.stack(cell).mean(0)
                    grid[sample, 6:9, x, y, z] = torch.tensor([x, y, z]) / voxels
                    grid[sample, 9, x, y, z] = float(bool(cell))
    return grid


def leaky(x: Tensor) -> Tensor:
    """The activation of all layers (PerAct2 code)."""
    return F.leaky_relu(x, 0.02)


def conv(x: Tensor, weight: Tensor, bias: Tensor, stride: int = 1, padding: int | None = None) -> Tensor:
    """A 3-D convolution whose border repeats the map's; without `stride` and `padding` it keeps the size."""
    width = weight.shape[-1] // 2 if padding is None else padding
    return F.conv3d(F.pad(x, (width,) * 6, mode="replicate"), weight, bias, stride)


def upsampled_conv(x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """From patches (b, c, p, p, p) to voxels (b, d, 5 p, 5 p, 5 p)."""
    return leaky(conv(F.interpolate(x, scale_factor=5, mode="trilinear", align_corners=False), weight, bias))


def spatial_softmax(x: Tensor) -> Tensor:
    """Where every channel of a map (b, c, x, y, z) peaks, (b, c, 3) in [-1, 1].

    A softmax over all voxels at the temperature 0.01 (PerAct2 code), then the expected coordinates.
    """
    probability = (x.flatten(2) / 0.01).softmax(-1)
    axes = [torch.linspace(-1, 1, n, dtype=x.dtype, device=x.device) for n in x.shape[2:]]
    coordinates = torch.stack(torch.meshgrid(*axes, indexing="ij")).flatten(1)  # (3, voxels)
    return torch.einsum("bcv,dv->bcd", probability, coordinates)


def pool(x: Tensor) -> Tensor:
    """Features of a map (b, c, x, y, z) for the pose heads: where each channel peaks, and how high, (b, 4 c)."""
    return torch.cat([spatial_softmax(x).flatten(1), x.flatten(2).max(-1).values], dim=1)


def attention(p: Parameters, name: str, x: Tensor, context: Tensor | None, heads: int) -> Tensor:
    """Queries `x` (b, n, d) look at `context` (b, m, e), or at each other: (b, n, d). Both are normalised first."""
    x = F.layer_norm(x, x.shape[-1:], p[f"{name}.norm.weight"], p[f"{name}.norm.bias"])
    if context is None:
        context = x
    else:
        weight, bias = p[f"{name}.norm_context.weight"], p[f"{name}.norm_context.bias"]
        context = F.layer_norm(context, context.shape[-1:], weight, bias)
    query = x @ p[f"{name}.query.weight"].T
    key, value = (context @ p[f"{name}.key_value.weight"].T).chunk(2, dim=-1)
    width = query.shape[-1] // heads
    outputs = []
    for head in range(heads):
        part = slice(head * width, (head + 1) * width)
        similarity = query[..., part] @ key[..., part].transpose(1, 2) / width**0.5
        outputs.append(similarity.softmax(-1) @ value[..., part])
    return torch.cat(outputs, -1) @ p[f"{name}.out.weight"].T + p[f"{name}.out.bias"]


def feed_forward(p: Parameters, name: str, x: Tensor) -> Tensor:
    """Every token on its own through a gated layer (GEGLU), four times as wide."""
    x = F.layer_norm(x, x.shape[-1:], p[f"{name}.norm.weight"], p[f"{name}.norm.bias"])
    value, gate = F.linear(x, p[f"{name}.widen.weight"], p[f"{name}.widen.bias"]).chunk(2, dim=-1)
    return F.linear(value * F.gelu(gate), p[f"{name}.narrow.weight"], p[f"{name}.narrow.bias"])


def block(p: Parameters, name: str, x: Tensor, heads: int) -> Tensor:
    """Self-attention and feed-forward, each added to what it read."""
    x = x + attention(p, f"{name}.attention", x, None, heads)
    return x + feed_forward(p, f"{name}.feed_forward", x)


def trunk(p: Parameters, tokens: Tensor, arms: int, heads: int) -> list[Tensor]:
    """Perceiver IO: what each arm's latents answer to every token, (b, t, token_dim) per arm.

    Without the last block, and with one arm's latents only, it is the trunk of PerAct.
    """
    name = "perceiver"
    latents = p[f"{name}.latents"].repeat(len(tokens), 1, 1)
    latents = latents + attention(p, f"{name}.read", latents, tokens, 1)
    parts = list(latents.chunk(arms, dim=1))
    depth = len({key.split(".")[3] for key in p if key.startswith(f"{name}.streams.0.")})
    for arm in range(arms):
        parts[arm] = parts[arm] + feed_forward(p, f"{name}.read_feed_forward.{arm}", parts[arm])
        for layer in range(depth):
            parts[arm] = block(p, f"{name}.streams.{arm}.{layer}", parts[arm], heads)
    if arms > 1:
        parts = list(block(p, f"{name}.combine", torch.cat(parts, dim=1), heads).chunk(arms, dim=1))
    return [attention(p, f"{name}.answer.{arm}", tokens, parts[arm], 1) for arm in range(arms)]


def network(
    p: Parameters, grid: Tensor, proprio: Tensor, language: Tensor, *, arms: int, heads: int
) -> tuple[Tensor, Tensor]:
    """From the voxel grid to the logits of all parts of the keypose.

    Args:
        p: parameters by name, of a `PerActNetwork` with the dense translation head.
        grid: (b, 10, v, v, v).
        proprio: (b, n) gripper, fingers and time, of all arms that are predicted.
        language: (b, words, language_dim).
        arms: arms to predict, 1 (PerAct) or 2 (PerAct2).
        heads: heads of the self-attentions.

    Returns:
        Translation logits (b, arms, v, v, v), and the pose heads' outputs (b, arms, 3 * bins + 4).
    """
    # 2. Tokens: (b, 64, v, v, v), (b, 64, p, p, p), and (b, words + p^3, 128).
    stem = leaky(conv(grid, p["stem.conv.weight"], p["stem.conv.bias"]))
    patches = leaky(conv(stem, p["patchify.conv.weight"], p["patchify.conv.bias"], stride=5, padding=2))
    proprio_features = leaky(F.linear(proprio, p["proprio.weight"], p["proprio.bias"]))
    size = patches.shape[-1]
    patches = torch.cat(
        [patches, proprio_features[:, :, None, None, None].expand(-1, -1, size, size, size)], dim=1
    )
    words = F.linear(language, p["language.weight"], p["language.bias"])
    tokens = torch.cat([words, patches.flatten(2).transpose(1, 2)], dim=1) + p["positions"]

    # 3. and 4. For each arm: up to voxels again, and pooled for the pose.
    translation, pose = [], []
    for arm, answer in enumerate(trunk(p, tokens, arms, heads)):
        answer = answer[:, words.shape[1] :].transpose(1, 2).reshape(len(grid), -1, size, size, size)
        coarse = leaky(conv(answer, p["translation.coarse.conv.weight"], p["translation.coarse.conv.bias"]))
        fine = upsampled_conv(
            coarse, p["translation.upsample.conv.weight"], p["translation.upsample.conv.bias"]
        )
        joined = torch.cat([stem, fine], dim=1)
        joined = leaky(conv(joined, p["translation.join.conv.weight"], p["translation.join.conv.bias"]))
        name = f"translation.logits.{arm}"
        translation.append(conv(joined, p[f"{name}.weight"], p[f"{name}.bias"])[:, 0])
        hidden = torch.cat([pool(stem), pool(answer), pool(joined)], dim=1)
        name = f"pose_heads.{arm}"
        for layer in range(2):
            hidden = leaky(F.linear(hidden, p[f"{name}.{layer}.weight"], p[f"{name}.{layer}.bias"]))
        pose.append(F.linear(hidden, p[f"{name}.2.weight"], p[f"{name}.2.bias"]))
    return torch.stack(translation, dim=1), torch.stack(pose, dim=1)


def one_hot_loss(translation: Tensor, pose: Tensor, voxel: Tensor, classes: Tensor) -> Tensor:
    """Cross-entropy from one-hot vectors, summed over parts and arms, averaged over the batch.

    Args:
        translation: (b, arms, v, v, v) logits.
        pose: (b, arms, 3 * bins + 4) logits.
        voxel: (b, arms, 3).
        classes: (b, arms, 5): three rotation bins, gripper open, ignore collisions.
    """
    voxels, bins = translation.shape[-1], (pose.shape[-1] - 4) // 3
    total = pose.new_zeros(len(pose))
    for sample in range(pose.shape[0]):
        for arm in range(pose.shape[1]):
            x, y, z = voxel[sample, arm].tolist()
            one_hot = pose.new_zeros(voxels, voxels, voxels)
            one_hot[x, y, z] = 1
            log_probability = translation[sample, arm].flatten().log_softmax(0)
            total[sample] -= (one_hot.flatten() * log_probability).sum()
            parts = pose[sample, arm].split([bins] * 3 + [2, 2])
            for logits, index in zip(parts, classes[sample, arm].tolist(), strict=True):
                total[sample] -= (
                    F.one_hot(torch.tensor(index, device=pose.device), len(logits)) * logits.log_softmax(0)
                ).sum()
    return total.mean()

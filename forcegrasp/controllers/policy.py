"""The learned policy: a Gaussian over actions whose mean is a small tanh network of the stacked observation."""

from __future__ import annotations

from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor


def make_policy(observation_size: int, hidden: list[int], log_std: float, action_size: int = 2) -> ProbabilisticActor:
    """Reads ``observation`` ``(*B, observation_size)``, writes ``action`` ``(*B, 2)`` and ``action_log_prob``.

    The standard deviation does not depend on the state. Actions are not squashed: the environment clips them to
    [−1, 1] (paper, Sec. 4).

    Args:
      observation_size: length of the stacked observation.
      hidden: width of each hidden layer.
      log_std: logarithm of the initial standard deviation.
    """
    net = MLP(in_features=observation_size, out_features=action_size, num_cells=list(hidden), activation_class=nn.Tanh)
    nn.init.orthogonal_(net[-1].weight, gain=0.01)
    nn.init.zeros_(net[-1].bias)
    scale = AddStateIndependentNormalScale(action_size, init_value=log_std)
    return ProbabilisticActor(
        TensorDictModule(nn.Sequential(net, scale), in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )

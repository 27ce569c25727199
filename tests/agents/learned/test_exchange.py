"""Policies of other libraries: the zip of Stable-Baselines3 without unpickling, and ONNX."""

import re
from pathlib import Path

import numpy as np
import pytest
import torch
from hostile_policies import ENV, OPTIONS, rows
from sb3_contrib import QRDQN, RecurrentPPO
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.torch_layers import FlattenExtractor

from agents.evaluation.registry import find_decider
from agents.interface.world_arguments import TRUST
from hybrid_env import ArgumentError

RELU = {"activation_fn": torch.nn.ReLU}
MODELS = {
    "two heads": lambda: A2C(
        "MlpPolicy", ENV, policy_kwargs=RELU | {"net_arch": {"pi": [8], "vf": [16, 4]}}
    ),
    "dqn": lambda: DQN("MlpPolicy", ENV, seed=1, buffer_size=10),
    "qrdqn": lambda: QRDQN(
        "MlpPolicy", ENV, seed=1, buffer_size=10, policy_kwargs={"n_quantiles": 7}
    ),
    "lstm": lambda: RecurrentPPO(
        "MlpLstmPolicy",
        ENV,
        seed=1,
        policy_kwargs={"lstm_hidden_size": 8, "enable_critic_lstm": False, "n_lstm_layers": 2},
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_saved_model_decides_as_the_library_does(name, tmp_path):
    model = MODELS[name]()
    model.save(tmp_path / "model.zip")
    decider = find_decider(str(tmp_path / "model.zip"), OPTIONS)
    decider = decider.at(0.0)
    state = None
    theirs = None
    for seen in rows():
        starts = np.full(5, state is None)
        actions, state = decider.predict(seen, state, starts)
        expected, theirs = model.predict(seen, theirs, starts, deterministic=True)
        np.testing.assert_array_equal(actions, expected)


class Doubled(FlattenExtractor):
    """An extractor that the file alone does not describe."""

    def __init__(self, space):
        super().__init__(space)
        self.gain = torch.nn.Parameter(torch.ones(1))

    def forward(self, observations):
        return 2.0 * self.gain * super().forward(observations)


def test_layers_of_ones_own_need_trust(tmp_path, monkeypatch):
    model = PPO("MlpPolicy", ENV, seed=1, policy_kwargs={"features_extractor_class": Doubled})
    model.save(tmp_path / "model.zip")
    with pytest.raises(ArgumentError, match="--trust"):
        find_decider(str(tmp_path / "model.zip"), OPTIONS)
    monkeypatch.setenv(TRUST, "1")
    decider = find_decider(str(tmp_path / "model.zip"), OPTIONS).at(0.0)
    for seen in rows(3):
        np.testing.assert_array_equal(
            decider.predict(seen)[0], model.predict(seen, deterministic=True)[0]
        )


# The exporter that needs no further package.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_an_exported_network_decides_by_the_program_of_the_page(tmp_path, monkeypatch):
    for package in ("onnx", "onnxruntime"):
        pytest.importorskip(package)
    page = (Path(__file__).parents[3] / "docs/deciders.md").read_text(encoding="utf-8")
    [program] = re.findall(r"```python\n(import onnxruntime.*?)```", page, re.DOTALL)
    (tmp_path / "exported.py").write_text(program)
    network = torch.nn.Linear(29, 4)
    monkeypatch.chdir(tmp_path)
    torch.onnx.export(
        network,
        (torch.zeros(3, 29),),
        "policy.onnx",
        dynamo=False,
        dynamic_axes={"rows": {0: "N"}},
        input_names=["rows"],
    )
    for margin in (0.0, 2.0):
        decider = find_decider(f"exported.py:network:{margin}", OPTIONS)
        for seen in rows(3):
            logits = network(torch.from_numpy(seen)).detach().numpy()
            logits[:, 0] += margin
            np.testing.assert_array_equal(decider.predict(seen)[0], logits.argmax(1))

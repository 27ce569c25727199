"""Policies of other libraries: the zip of Stable-Baselines3 without unpickling, and ONNX."""

import numpy as np
import pytest
import torch
from hostile_policies import ENV, OPTIONS, rows
from sb3_contrib import QRDQN, RecurrentPPO
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.torch_layers import FlattenExtractor

from agents.cli import main
from agents.evaluation.registry import find_decider
from agents.interface.world_arguments import TRUST, trusted
from baselines.rules.rollout import evaluate
from hybrid_env import ArgumentError

RELU = {"activation_fn": torch.nn.ReLU}
MODELS = {
    "two heads": lambda: A2C(
        "MlpPolicy",
        ENV,
        policy_kwargs=RELU | {"net_arch": {"pi": [8], "vf": [16, 4]}},
    ),
    "linear": lambda: A2C("MlpPolicy", ENV, seed=1, policy_kwargs={"net_arch": []}),
    "dqn": lambda: DQN("MlpPolicy", ENV, seed=1, buffer_size=10),
    "qrdqn": lambda: QRDQN(
        "MlpPolicy",
        ENV,
        seed=1,
        buffer_size=10,
        policy_kwargs={"n_quantiles": 7},
    ),
    "lstm": lambda: RecurrentPPO(
        "MlpLstmPolicy",
        ENV,
        seed=1,
        policy_kwargs={
            "lstm_hidden_size": 8,
            "enable_critic_lstm": False,
            "n_lstm_layers": 2,
        },
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_saved_model_decides_as_the_library_does(name, tmp_path):
    model = MODELS[name]()
    model.save(tmp_path / "model.zip")
    decider = find_decider(str(tmp_path / "model.zip"), OPTIONS)
    threshold = decider.threshold

    assert (decider.title, threshold, decider.hypotheses) == ("model", 0.0, 3)
    assert len(decider.thresholds) > 10
    decider = decider.at(0.0)
    state = None
    theirs = None
    for seen in rows():
        starts = np.full(5, state is None)
        actions, state = decider.predict(seen, state, starts)
        expected, theirs = model.predict(seen, theirs, starts, deterministic=True)
        np.testing.assert_array_equal(actions, expected)
    assert evaluate(decider.at(decider.thresholds[-1]), episodes=3).ticks.shape == (3, 6)


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
            decider.predict(seen)[0],
            model.predict(seen, deterministic=True)[0],
        )


def test_trust_ends_with_its_command(tmp_path, capsys):
    policy_kwargs = {"features_extractor_class": Doubled}
    PPO("MlpPolicy", ENV, seed=1, policy_kwargs=policy_kwargs).save(tmp_path / "model.zip")
    line = ["evaluate", str(tmp_path / "model.zip"), "--env", ENV, "--scheme", "S9"]
    main([*line, "--trust", "--episodes", "1"])

    assert not trusted()
    capsys.readouterr()
    assert main([*line, "--episodes", "1"]) == 2
    assert "--trust" in capsys.readouterr().err


def test_an_onnx_file_of_logits_or_of_actions_decides(tmp_path):
    pytest.importorskip("onnxruntime")
    onnx = pytest.importorskip("onnx")
    helper, FLOAT, INT = onnx.helper, onnx.TensorProto.FLOAT, onnx.TensorProto.INT64
    weight = np.random.default_rng(0).normal(size=(28, 4)).astype(np.float32)
    nodes = [
        helper.make_node("MatMul", ["rows", "weight"], ["logits"]),
        helper.make_node(
            "ArgMax",
            ["logits"],
            ["actions"],
            axis=1,
            keepdims=0,
        ),
    ]
    given = helper.make_tensor_value_info("rows", FLOAT, ["N", 28])
    outputs = {
        "logits": helper.make_tensor_value_info("logits", FLOAT, ["N", 4]),
        "actions": helper.make_tensor_value_info("actions", INT, ["N"]),
    }
    for name, out in outputs.items():
        graph = helper.make_graph(
            nodes[: 1 if name == "logits" else 2],
            name,
            [given],
            [out],
            [onnx.numpy_helper.from_array(weight, "weight")],
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", 17)],
            ir_version=8,
        )
        onnx.save(model, tmp_path / f"{name}.onnx")
        decider = find_decider(str(tmp_path / f"{name}.onnx"), OPTIONS)
        assert len(decider.thresholds) == (18 if name == "logits" else 1)
        for seen in rows(3):
            actions, _ = decider.at(0.0).predict(seen)
            np.testing.assert_array_equal(actions, (seen @ weight).argmax(1))
    (tmp_path / "cut.onnx").write_bytes((tmp_path / "logits.onnx").read_bytes()[:100])
    with pytest.raises(ArgumentError, match="a policy that can be read"):
        find_decider(str(tmp_path / "cut.onnx"), OPTIONS)

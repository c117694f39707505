"""Two networks that do next to nothing, to see that pictures go in and maps come out where they should.

identity.onnx: 1x3xHxW in, the same out. channels-last.onnx: 1xHxWx3 in, 1x4xHxW out: the picture and a confidence of its first channel.

    pip install onnx && python models.py
"""

import pathlib

import onnx
from onnx import TensorProto, helper

HERE = pathlib.Path(__file__).parent


def save(name, nodes, shape_in, shape_out):
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, shape_in)
    normal = helper.make_tensor_value_info("normal", TensorProto.FLOAT, shape_out)
    graph = helper.make_graph(nodes, name, [image], [normal])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, HERE / f"{name}.onnx")


save("identity", [helper.make_node("Identity", ["image"], ["normal"])], [1, 3, "h", "w"], [1, 3, "h", "w"])
save(
    "channels-last",
    [
        helper.make_node("Transpose", ["image"], ["first"], perm=[0, 3, 1, 2]),
        helper.make_node("Split", ["first"], ["r", "g", "b"], axis=1),
        helper.make_node("Concat", ["r", "g", "b", "r"], ["normal"], axis=1),
    ],
    [1, 16, 24, 3],
    [1, 4, 16, 24],
)

"""Remeshes a generated surface and reads the result into NumPy arrays that are views of the received bytes.

python3 remesh_to_numpy.py HOST:PORT      needs grpcio, grpcio-tools and numpy
"""

import pathlib
import sys
import tempfile

import grpc
import numpy as np
from grpc_tools import protoc


def make_stubs(folder):
    """Generates the stubs from the .proto files beside the daemon's sources and makes them importable."""
    root = pathlib.Path(__file__).resolve().parents[2] / "proto"
    well_known = pathlib.Path(protoc.__file__).parent / "_proto"
    files = [str(path) for path in sorted(root.glob("remesh/v1/*.proto"))]
    options = [f"-I{root}", f"-I{well_known}", f"--python_out={folder}", f"--grpc_python_out={folder}"]
    if protoc.main(["protoc", *options, *files]) != 0:
        raise SystemExit("protoc failed")
    sys.path.insert(0, str(folder))


def read_columns(stub, request, kinds):
    """The columns of a mesh by name. A chunk is viewed, not copied; a column of several chunks is put together once."""
    chunks = {}
    for answer in stub.ReadMeshData(request):
        if answer.WhichOneof("part") == "chunk":
            chunks.setdefault(answer.chunk.column, []).append(answer.chunk.data)
    columns = {}
    for kind, (dtype, width) in kinds.items():
        pieces = [np.frombuffer(data, dtype=dtype) for data in chunks.get(kind, [])]
        whole = pieces[0] if len(pieces) == 1 else np.concatenate(pieces or [np.empty(0, dtype)])
        columns[kind] = whole.reshape(-1, width)
    return columns


def main(address):
    with tempfile.TemporaryDirectory() as folder:
        make_stubs(pathlib.Path(folder))
        from remesh.v1 import common_pb2, mesh_pb2, mesh_pb2_grpc, remesh_pb2, remesh_pb2_grpc
        from remesh.v1 import session_pb2, session_pb2_grpc, spec_pb2

    channel = grpc.insecure_channel(address)
    sessions = session_pb2_grpc.SessionServiceStub(channel)
    meshes = mesh_pb2_grpc.MeshServiceStub(channel)
    remeshing = remesh_pb2_grpc.RemeshServiceStub(channel)

    session = sessions.CreateSession(session_pb2.CreateSessionRequest(display_name="python")).session.name
    sample = mesh_pb2.SampleSpec(kind="SAMPLE_KIND_TUBE", triangles=4000)
    meshes.ImportMesh(mesh_pb2.ImportMeshRequest(session=session, sample=sample))
    change = session_pb2.Change(size=spec_pb2.SizeSpec(triangles=3000))
    sessions.ApplyChange(session_pb2.ApplyChangeRequest(session=session, change=change))
    for event in remeshing.RemeshSurface(remesh_pb2.RemeshSurfaceRequest(session=session)):
        if event.WhichOneof("event") == "result":
            print(f"{event.result.mesh.faces} triangles, mean kappa {event.result.shape.kappa_mean:.3f}")

    positions, triangles = common_pb2.DATA_COLUMN_POSITIONS, common_pb2.DATA_COLUMN_TRIANGLES
    request = mesh_pb2.ReadMeshDataRequest(session=session, source="MESH_SOURCE_RESULT", columns=[positions, triangles])
    arrays = read_columns(meshes, request, {positions: ("<f8", 3), triangles: ("<u4", 3)})
    points, faces = arrays[positions], arrays[triangles]
    # Views of the bytes that came: NumPy owns none of it.
    assert not points.flags.owndata and not points.flags.writeable
    corners = points[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    print(f"{len(points)} vertices, {len(faces)} triangles, area {areas.sum():.4f}")
    sessions.DeleteSession(session_pb2.DeleteSessionRequest(name=session))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:50061")

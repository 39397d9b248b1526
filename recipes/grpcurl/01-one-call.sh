# One call: a generated artery in, remeshed triangles out as an STL file. sh 01-one-call.sh out.stl
. "$(dirname "$0")/common.sh"
call RemeshService/RemeshMesh '{
  "sample": {"kind": "SAMPLE_KIND_ARTERY", "triangles": 4000},
  "size": {"triangles": 2000},
  "output_format": "MESH_FORMAT_STL", "output_encoding": "MESH_ENCODING_BINARY"
}' | field data | base64 -d > "${1:-/dev/null}"
echo "remeshed"

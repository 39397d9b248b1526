# A session step by step: create, import, set a size, look at the plan, remesh, edit, remesh again, export, delete.
. "$(dirname "$0")/common.sh"
session=$(call SessionService/CreateSession '{"display_name": "recipe"}' | field name)
call MeshService/ImportMesh '{"session": "'$session'", "sample": {"kind": "SAMPLE_KIND_PELVIS", "triangles": 4000}}' > /dev/null
call SessionService/ApplyChange '{"session": "'$session'", "base_revision": 1, "change": {"size": {"triangles": 2000}}}' > /dev/null
echo "would run: $(call RemeshService/PlanRemesh '{"session": "'$session'"}' | sed -n 's/.*"runs": \([0-9]*\).*/\1/p') stages"
call RemeshService/RemeshSurface '{"session": "'$session'"}' > /dev/null
call SessionService/ApplyChange '{"session": "'$session'", "change": {"size": {"triangles": 3000}}}' > /dev/null
call RemeshService/RemeshSurface '{"session": "'$session'"}' > /dev/null
echo "undo makes revision $(call SessionService/UndoChange '{"session": "'$session'"}' | field revision)"
echo "hits after undo: $(call RemeshService/PlanRemesh '{"session": "'$session'"}' | sed -n 's/.*"hits": \([0-9]*\).*/\1/p')"
bytes=$(call MeshService/ExportMesh '{"session": "'$session'", "source": "MESH_SOURCE_RESULT", "format": "MESH_FORMAT_OFF"}' | field totalBytes)
echo "the result as OFF has $bytes bytes"
call SessionService/DeleteSession '{"name": "'$session'"}' > /dev/null

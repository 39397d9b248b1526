# Long work that outlives its call: start it, wait for it, read its outcome; start another one and cancel it.
. "$(dirname "$0")/common.sh"
session=$(call SessionService/CreateSession '{}' | field name)
call MeshService/ImportMesh '{"session": "'$session'", "sample": {"kind": "SAMPLE_KIND_TUBE", "triangles": 4000}}' > /dev/null
call SessionService/ApplyChange '{"session": "'$session'", "change": {"size": {"triangles": 3000}}}' > /dev/null
work=$(call OperationService/StartOperation '{"session": "'$session'", "remesh": {}}' | field name)
echo "outcome: $(call OperationService/WaitOperation '{"name": "'$work'", "timeout": "60s"}' | field state)"
call SessionService/ApplyChange '{"session": "'$session'", "change": {"size": {"triangles": 400000}}}' > /dev/null
work=$(call OperationService/StartOperation '{"session": "'$session'", "remesh": {}}' | field name)
call OperationService/CancelOperation '{"name": "'$work'"}' > /dev/null
echo "outcome: $(call OperationService/WaitOperation '{"name": "'$work'", "timeout": "60s"}' | field state)"
call SessionService/DeleteSession '{"name": "'$session'"}' > /dev/null

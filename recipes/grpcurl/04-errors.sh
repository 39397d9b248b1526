# Errors say what, why and where: a stale revision, an option that is wrong, a session that is not there. grpcurl exits with 64 + the code.
. "$(dirname "$0")/common.sh"
session=$(call SessionService/CreateSession '{}' | field name)
call SessionService/ApplyChange '{"session": "'$session'", "change": {"size": {"uniform": 1}}}' > /dev/null
stale='{"session": "'$session'", "base_revision": 0, "change": {"size": {"uniform": 2}}}'
call SessionService/ApplyChange "$stale" 2>&1 | sed -n 's/.*"reason":"\([A-Z_]*\)".*/\1/p' || true
wrong='{"session": "'$session'", "change": {"size": {"uniform": -1}}}'
call SessionService/ApplyChange "$wrong" 2>&1 | sed -n 's/.*"reason":"\([A-Z_]*\)".*/\1/p' | head -n 1 || true
call SessionService/DeleteSession '{"name": "'$session'"}' > /dev/null
call SessionService/GetSession '{"name": "'$session'"}' 2>&1 | sed -n 's/.*"reason":"\([A-Z_]*\)".*/\1/p' || true

# For the other recipes: `call METHOD JSON` calls the daemon, `field NAME` reads a text field of the first answer.
set -eu
REMESHD=${REMESHD:-127.0.0.1:50061}
call() { grpcurl -plaintext -d "$2" "$REMESHD" "remesh.v1.$1"; }
field() { sed -n "s/.*\"$1\": \"\([^\"]*\)\".*/\1/p" | head -n 1; }

# Whether the daemon lives, whether it takes calls, what it offers and how full it is.
. "$(dirname "$0")/common.sh"
for service in liveness readiness; do
  echo "$service: $(grpcurl -plaintext -d '{"service": "'$service'"}' "$REMESHD" grpc.health.v1.Health/Check | field status)"
done
grpcurl -plaintext "$REMESHD" list
echo "version $(call CapabilityService/GetCapabilities '{}' | field version)"
call CapabilityService/GetCacheUsage '{}'

#!/usr/bin/env bash
# A one-node SLURM on this machine (Debian, as root), a small study and a Monte Carlo on it, and the same bytes as
# without: `make test-cluster`. Whatever it starts, it ends.
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
python=${PYTHON:-$project/.venv/bin/python}
known=/etc/slurm/slurm.conf  # where jobs look for it: nothing of the environment reaches their steps
started=()
finish() {
  for process in "${started[@]}"; do kill "$process" 2>/dev/null || true; done
  [ -L "$known" ] && rm -f "$known"
  echo "what the test wrote stands in $work"
}
trap finish EXIT

if ! command -v slurmctld >/dev/null || ! command -v munged >/dev/null; then
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge >/dev/null
fi
"$python" -m pip install --quiet --disable-pip-version-check snakemake-executor-plugin-slurm

# One node, one key, no accounting: what a plain machine can run.
host=$(hostname -s)
mkdir -p "$work"/{state,spool,munge}
head -c 1024 /dev/urandom > "$work/munge/munge.key"
chmod 700 "$work/munge" && chmod 600 "$work/munge/munge.key"
munged --foreground --force --socket="$work/munge/socket" --key-file="$work/munge/munge.key" \
  --pid-file="$work/munge/pid" --log-file="$work/munge/log" --seed-file="$work/munge/seed" 2>/dev/null &
started+=($!)
cat > "$work/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CryptoType=crypto/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MailProg=/bin/true
ReturnToService=2
SlurmctldPort=16817
SlurmdPort=16818
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
if [ -e "$known" ] && [ ! -L "$known" ]; then echo "$known: this machine has a SLURM of its own"; exit 2; fi
mkdir -p "${known%/*}" && ln -sfn "$work/slurm.conf" "$known"
slurmctld -D 2>/dev/null & started+=($!)
slurmd -D 2>/dev/null & started+=($!)
for _ in $(seq 60); do sinfo -h -o %T 2>/dev/null | grep -q idle && break; sleep 1; done
sinfo

copy() {  # a project of its own, with a Monte Carlo of a few seeds
  mkdir "$1"
  cp -r "$project"/{Snakefile,rules,config,models,scripts,study,profiles} "$1"
  sed -i '/^monte_carlo:/,/seeds:/ s/seeds: .*/seeds: 20/' "$1/config/config.yaml"
}
targets=(duffing noise_5 results/monte_carlo/duffing.csv)
copy "$work/here" && copy "$work/cluster"
export PYTHONPATH= OPENBLAS_NUM_THREADS=1
(cd "$work/here" && time PYTHONPATH=$work/here "$python" -m snakemake -j2 "${targets[@]}") 2>&1 | tail -5
(cd "$work/cluster" && time PYTHONPATH=$work/cluster "$python" -m snakemake --profile profiles/slurm "${targets[@]}") 2>&1 | tail -25
count=0
while read -r -d '' file; do
  cmp "$work/here/$file" "$work/cluster/$file"
  count=$((count + 1))
done < <(cd "$work/here" && find results figures -type f ! -path '*benchmarks*' -print0)
test "$count" -gt 10
echo "$count files, the same bytes on the cluster as without"

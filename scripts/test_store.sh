#!/usr/bin/env bash
# What Kubernetes asks of the study, without one: jobs in empty folders that share nothing but a bucket of a local S3
# server, and the same bytes as without (the second part of `make test-cluster`). Whatever it starts, it ends.
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
python=${PYTHON:-$project/.venv/bin/python}
port=${PORT:-15159}
finish() {
  [ -z "${server:-}" ] || kill "$server" 2>/dev/null || true
  echo "what the test wrote stands in $work"
}
trap finish EXIT
"$python" -m pip install --quiet --disable-pip-version-check \
  snakemake-storage-plugin-s3 snakemake-executor-plugin-cluster-generic snakemake-executor-plugin-kubernetes 'moto[server]'

"$python" -c 'import sys; from moto.server import main; main(sys.argv[1:])' -H 127.0.0.1 -p "$port" >"$work/server" 2>&1 &
server=$!
export SNAKEMAKE_STORAGE_S3_ENDPOINT_URL=http://127.0.0.1:$port
export SNAKEMAKE_STORAGE_S3_ACCESS_KEY=test SNAKEMAKE_STORAGE_S3_SECRET_KEY=test AWS_DEFAULT_REGION=us-east-1

copy() {  # a project of its own, with a Monte Carlo of a few seeds
  mkdir "$1"
  cp -r "$project"/{Snakefile,rules,config,models,scripts,study,profiles} "$1"
  sed -i '/^monte_carlo:/,/seeds:/ s/seeds: .*/seeds: 20/' "$1/config/config.yaml"
}
targets=(duffing noise_5 results/monte_carlo/duffing.csv)
copy "$work/here" && copy "$work/away"
export OPENBLAS_NUM_THREADS=1
(cd "$work/here" && time PYTHONPATH=$work/here "$python" -m snakemake -j2 "${targets[@]}") 2>&1 | tail -5

# The bucket as the profile wants it: the project's inputs, and none of its results.
store() {  # put <folder> into the bucket, or get the bucket's results into it
  "$python" - "$1" "$2" <<'CODE'
import os, sys
from pathlib import Path
import boto3
known = {key: os.environ[f"SNAKEMAKE_STORAGE_S3_{key.upper()}"] for key in ("endpoint_url", "access_key", "secret_key")}
bucket = boto3.resource("s3", endpoint_url=known["endpoint_url"], aws_access_key_id=known["access_key"],
                        aws_secret_access_key=known["secret_key"]).Bucket("study")
folder = Path(sys.argv[2])
if sys.argv[1] == "put":
    bucket.create()
    for path in [p for part in ("models", "config", "study") for p in (folder / part).rglob("*") if p.is_file()]:
        if path.suffix not in (".pyc", ".so"):
            bucket.upload_file(str(path), str(path.relative_to(folder)))
else:
    for item in [i for part in ("results/", "figures/") for i in bucket.objects.filter(Prefix=part)]:
        (folder / item.key).parent.mkdir(parents=True, exist_ok=True)
        bucket.download_file(item.key, str(folder / item.key))
CODE
}
for _ in $(seq 60); do grep -q "Running on" "$work/server" && break; sleep 1; done
store put "$work/away"

# A pod is an empty folder: what a job needs comes with it, from the bucket, or is installed in its image.
"$python" -m pip install --quiet --disable-pip-version-check --no-deps --target "$work/image" "$project"
mkdir "$work/pods"
cat > "$work/submit" <<POD
#!/usr/bin/env bash
folder=\$(mktemp -d "$work/pods/XXXXXX") && cd "\$folder" && export PYTHONPATH="$work/image"
(if bash "\$1" >out 2>&1; then echo success; else echo failed; fi >ending; mv ending ended) </dev/null >/dev/null 2>&1 &
echo "\$folder"
POD
cat > "$work/status" <<'POD'
#!/usr/bin/env bash
if [ -e "$1/ended" ]; then cat "$1/ended"; else echo running; fi
POD
chmod +x "$work/submit" "$work/status"
(
  cd "$work/away"
  printf '%s\n' __pycache__/ .snakemake/ /results/ /figures/ '*.so' > .gitignore
  git init -q . && git add -A
  export PATH="$(dirname "$python"):$PATH"
  time PYTHONPATH=$work/away "$python" -m snakemake --profile profiles/kubernetes --executor cluster-generic --jobs 2 \
    --cluster-generic-submit-cmd "$work/submit" --cluster-generic-status-cmd "$work/status" \
    --seconds-between-status-checks 1 "${targets[@]}"
) >"$work/run" 2>&1 || { tail -25 "$work/run"; tail -n 15 "$work"/pods/*/out; exit 1; }
tail -4 "$work/run"

mkdir "$work/got" && store get "$work/got"
count=0
while read -r -d '' file; do
  cmp "$work/here/$file" "$work/got/$file"
  count=$((count + 1))
done < <(cd "$work/here" && find results figures -type f ! -path '*benchmarks*' -print0)
test "$count" -gt 10
test "$(find "$work/pods" -mindepth 1 -maxdepth 1 | wc -l)" -ge 7
test ! -e "$work/away/results/duffing/record.csv"
echo "$count files, the same bytes from the store as without"

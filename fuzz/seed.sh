#!/usr/bin/env bash
# Fills fuzz/corpus/TARGET from the small glTF files under a folder (default: ../shared/assets beside the project).
# usage: fuzz/seed.sh [TARGET] [FOLDER]
set -euo pipefail
cd "$(dirname "$0")"
target=${1:-import}
folder=${2:-../../shared/assets}
mkdir -p "corpus/$target"
find "$folder" ../tests/fixtures/import -type f \( -name '*.gltf' -o -name '*.glb' \) -size -48k -print0 |
    while IFS= read -r -d '' file; do
        cp --no-preserve=mode "$file" "corpus/$target/$(sha256sum "$file" | cut -c1-16)"
    done
ls "corpus/$target" | wc -l

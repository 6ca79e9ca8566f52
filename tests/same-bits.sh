#!/usr/bin/env bash
# Renders 30 settings by two binaries and compares the files bit for bit: `tests/same-bits.sh OLD NEW [FOLDER]`. FOLDER
# holds further scenes (conference_4pt.glb, ...); without it their settings take a built-in room. Exits with 1 where any differ.
set -uo pipefail
[ $# -ge 2 ] || { echo "usage: $0 OLD NEW [FOLDER]" >&2; exit 2; }
old=$1 new=$2 folder=${3:-}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

scene() { [ -f "$folder/$1" ] && echo "$folder/$1" || echo "builtin:$2"; }
conference=$(scene conference_4pt.glb conference) office=$(scene office_2pt.glb office)
glass=$(scene cabin.glb office) coats=$(scene ../gltf-samples/ClearCoatTest/glTF-Binary/ClearCoatTest.glb conference)
lobes=$(scene veach-mis.glb cornell) hall=$(scene sponza.glb conference) stairs=$(scene staircase2.glb office)

settings=(
    "builtin:cornell"
    "builtin:office"
    "builtin:conference"
    "$conference --preset paper-canonical"
    "$conference --preset paper-imperfect"
    "$conference --preset paper-downsampled"
    "$conference --preset paper-interleaved"
    "$conference --preset fast"
    "$office --preset fast --vpls 1440 --bounces 8"
    "$office -D indirect.visibility=boxes-plane -D indirect.box_split=0.5"
    "$office -D indirect.visibility=boxes-inline"
    "$office -D indirect.compensation=4 -D indirect.downsample=2"
    "$office --preset fast -D indirect.compensation=2"
    "$office -D indirect.interleave=3 -D indirect.pattern=irregular"
    "$office --vpls 4000 --bounces 5 --seed 7"
    "$office --crop 11,7,40,30 --preset fast"
    "$office -D pixel_samples=4 --aov albedo,N,P,direct,specular,indirect,glossy,irradiance,depth"
    "$coats -D whitted.light_samples=300"
    "$glass -D whitted.specular_depth=8"
    "$stairs"
    "$lobes --vpls 700"
    "$hall --environment 1,1,1"
    "builtin:cornell --environment 0.5,1,2 --glare 0.2 --tone-map aces"
    "builtin:cornell --method path --spp 8"
    "$office --method path --spp 4 --aov albedo,N,P,depth,variance,half_a,half_b"
    "$conference --method path --spp 4 --transport diffuse-indirect --max-depth 5"
    "$glass --method path --spp 4 --estimator naive"
    "$office --method path --spp 40 --adaptive --aov rate"
    "builtin:cornell --method path --spp 4 --crop 5,5,30,20 --seed 3"
    "builtin:cornell --backend ray-query --vpls 60"
)
differ=0
for index in "${!settings[@]}"; do
    words=${settings[$index]}
    [[ $words == *--backend* ]] && backend= || backend='--backend software'
    for binary in old new; do
        # shellcheck disable=SC2086
        "${!binary}" render $backend --size 48x36 --quiet $words \
            -o "$scratch/$binary.exr" -o "$scratch/$binary.png" >"$scratch/$binary.txt" 2>&1 ||
            { echo "$((index + 1)) FAILED by the $binary binary: $words"; cat "$scratch/$binary.txt"; }
    done
    if "$new" compare --exact "$scratch/old.exr" "$scratch/new.exr" >"$scratch/compare.txt" 2>&1 && cmp -s "$scratch/old.png" "$scratch/new.png"; then
        echo "$((index + 1)) same: ${words//"$folder"\//}"
    else
        differ=$((differ + 1))
        echo "$((index + 1)) DIFFERS: $words"
        cat "$scratch/compare.txt"
    fi
    rm -f "$scratch"/*.exr "$scratch"/*.png
done
echo "$((${#settings[@]} - differ)) same, $differ different"
[ "$differ" = 0 ]

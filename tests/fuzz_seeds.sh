#!/bin/bash
# Seeds for the fuzz targets: small sound files of every kind, one folder per parser.
#
#   tests/fuzz_seeds.sh DIR
set -euo pipefail
folder=$1
for name in ply obj xyz npy pcd config store rig sensors image; do mkdir -p "$folder/$name"; done
cd "$folder"

xyz='property float x\nproperty float y\nproperty float z\n'
faces='element face 2\nproperty list uchar int vertex_indices\n'
rows='0 0 0\n1 0 0\n0 1 0\n0 0 1\n'
floats='\0\0\0\0\0\0\200\77\0\0\0\100\0\0\0\0' # 0 1 2 0

printf "ply\nformat ascii 1.0\ncomment made\nelement vertex 4\n$xyz${faces}end_header\n${rows}3 0 1 2\n3 0 2 3\n" >ply/ascii
printf "ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty double x\r\nproperty double y\r\nproperty double z\r\nend_header\r\n1e5 -2 .5\r\n" >ply/crlf
printf "ply\nformat binary_little_endian 1.0\nelement vertex 3\n$xyz${faces}end_header\n$floats$floats\0\0\0\0\3\0\0\0\0\1\0\0\0\2\0\0\0\4\0\0\0\0\1\0\0\0\2\0\0\0\0\0\0\0" >ply/little
printf "ply\nformat binary_big_endian 1.0\nelement vertex 1\n${xyz}property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n\77\200\0\0\0\0\0\0\100\0\0\0\377\0\1" >ply/big
printf "ply\nformat ascii 1.0\nelement thing 1\nproperty list int float a\nelement vertex 2\n${xyz}property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\nend_header\n2 1 2\n0 0 0 0 0 1 0 1\nnan inf -1e30 1 0 0 1 0\n" >ply/normals
printf 'mtllib a.mtl\no one\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/3/1\nf -1 -2 -3\nl 1 2\n# end\n' >obj/mesh
printf 'v 1 2 3\nv 4 5 6\r\nv 7e-3 8 9\n' >obj/points
printf '1 2 3\n4 5 6\n-7e2 nan inf\n' >xyz/plain
printf 'x y z nx ny nz\n1,2,3,0,0,1\n4,5,6,0,1,0\n' >xyz/commas
printf '2\n1 2 3 10 20 30\n4 5 6 10 20 30\n' >xyz/counted
npy() { # DESCR ORDER SHAPE: a header of 118 bytes
    printf '\223NUMPY\1\0\166\0%-117s\n' "{'descr': '$1', 'fortran_order': $2, 'shape': $3, }"
}
{ npy '<f4' False '(2, 3)' && printf "$floats\0\0\200\77\0\0\0\0"; } >npy/single
{ npy '>f8' True '(1, 3)' && printf '\100\0\0\0\0\0\0\0%.0s' 1 2 3; } >npy/double
{ npy '<f4' False '(1, 6)' && printf "$floats\0\0\0\0\0\0\200\77"; } >npy/normals
printf '\223NUMPY\1\0\77\0%51s%s' '' "'descr': '>f4', 'fortran_order': True, 'shape': (2, 3)" >npy/cut_type
pcd() { # FIELDS SIZES TYPES COUNTS POINTS DATA
    printf 'VERSION 0.7\nFIELDS %s\nSIZE %s\nTYPE %s\nCOUNT %s\nWIDTH %s\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %s\nDATA %s\n' \
        "$1" "$2" "$3" "$4" "$5" "$5" "$6"
}
{ pcd 'x y z' '4 4 4' 'F F F' '1 1 1' 2 ascii && printf '1 2 3\nnan nan nan\n'; } >pcd/ascii
{ pcd 'x y z rgb' '4 4 4 4' 'F F F U' '1 1 1 1' 1 binary && printf "$floats"; } >pcd/binary
{ pcd 'x y z normal_x normal_y normal_z' '8 8 8 4 4 4' 'F F F F F F' '1 1 1 1 1 1' 1 ascii && printf '1 2 3 0 0 1\n'; } >pcd/normals
{ pcd 'x y z' '4 4 4' 'F F F' '1 1 1' 1 binary_compressed && printf '\15\0\0\0\14\0\0\0\13\0\0\0\0\0\0\200\77\0\0\0\100'; } >pcd/packed

printf '{"whole": 3, "real": 1.5e3, // a word\n "flag": true, "choice": "two", "text": "a\\u00e9\\n", "seed": 4294967295}\n' >config/all
printf '{"preset": "paper", "input": "in/%%04d.ply", "keep-going": "no", "chunk": 1024}' >config/run
printf '{"optimization": {"epochs": 2}, "grid": {"solver": "CG", "whole": 3}, "rotation_method": "x"}' >config/published
printf '{"text": "// no comment \\" here", "whole": -5}//' >config/comment

block() { # NAME SIZE BYTES: as in pipeline/store.h
    local i
    printf '%s' "$1" && for ((i = ${#1}; i < 32; i++)); do printf '\0'; done
    printf "\\$(printf %o "$2")\0\0\0\0\0\0\0" && printf "$3"
    for ((i = $2; i % 8; i++)); do printf '\0'; done
}
{
    block reference 16 '\3\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0'
    block reference.vertices 36 "$floats$floats\0\0\200\77"
    block reference.normals 36 "$floats$floats\0\0\200\77"
    block reference.faces 12 '\0\0\0\0\1\0\0\0\2\0\0\0'
    block reference.colours 12 'abcdefghijkl'
    block held 8 '\0\0\0\0\0\0\0\0'
} >store/reference
block text 7 'seven b' >store/small
mkdir -p manifest
printf '{"output": "results", // here\n "defaults": {"whole": 60, "max-time": 7200, "segments": "auto"},\n "captures": [{"input": "dancer"}, {"input": "horse/scan_%%04d.ply", "name": "horse", "method": "fit.json", "flag": true, "reference": "a.ply"}]}\n' >manifest/two
printf '{"captures": [{"input": "/in/a", "name": "..", "text": "x"}, {"input": "b", "max-time": 1.5, "segments": "one", "confine": false}]}' >manifest/names

camera='"camera": {"width": 4, "height": 3, "fx": 5, "fy": 5, "cx": 1.5, "cy": 1, "distortion": [0.1, 0, 0, 0]}'
pose='"pose": [1,0,0,5, 0,1,0,6, 0,0,1,7, 0,0,0,1]'
printf '{"neupig_rig": 1, "axes": "opengl", "sensors": [{"name": "a", "depth": "d_%%04d.png", "mask": "m_####.jpg", %s, %s}]}' "$camera" "$pose" >rig/numbered
printf '{"neupig_rig": 1, "sensors": [{"depth": [null, null], "poses": [], %s, "near": 1}]}' "$camera" >rig/listed
printf '{"neupig_rig": 1, "sensors": [{"depth": "d_%%d.png", %s, "colour": "c", "colour_camera": {"from_depth": []}}]}' "$camera" >rig/colour
printf '# x y z\n1 2 3\n 4 5e0 6\n' >sensors/places
printf '1 1 2 3\n1 4 5 6\n0 7 8 9\n' >sensors/numbered
image() { # FILE KIND BASE64...: kind 0 depth, 1 mask, 2 colour; 24 x 24 pixels
    local file=$1 kind=$2
    shift 2
    { printf "\\$kind" && printf '%s' "$@" | base64 -d; } >image/"$file"
}
image depth 0 'iVBORw0KGgoAAAANSUhEUgAAABgAAAAYEAAAAACVjL5nAAAABGdBTUEAAYagMeiWXwAAACBjSFJNAAB6JgAAgIQAAPoAAACA' \
    '6AAAdTAAAOpgAAA6mAAAF3CculE8AAAAH0lEQVQ4jWNkfsGAChjx85kYSASjGkY1jGoY1UAaAACxxQEdYOsCFgAAAABJRU5E' \
    'rkJggg=='
image colour 2 'iVBORw0KGgoAAAANSUhEUgAAABgAAAAYCAIAAABvFaqvAAAAAXNSR0IArs4c6QAAACNJREFUOI1jZMABAkgUZ8JlEKlg1KBR' \
    'g0YNGjVo1KBRg8gHANs0ANDkkJomAAAAAElFTkSuQmCC'
image jpeg 1 '/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDABsSFBcUERsXFhceHBsgKEIrKCUlKFE6PTBCYFVlZF9VXVtqeJmBanGQc1tdhbWG' \
    'kJ6jq62rZ4C8ybqmx5moq6T/wAALCAAYABgBAREA/8QAFwAAAwEAAAAAAAAAAAAAAAAAAAIDBf/EACsQAAADBAgGAwAAAAAA' \
    'AAAAAAECIQARQVEDEhMiMTJC4UNSYbHB8CNigf/aAAgBAQAAPwDBMBaxkJmpNAyTaUWCgWsVCZqPQMl3nBkSzwK+z5Rfm79f' \
    'LUMN817VScV8PViwUb5b2qj4roerBkf8WPD5/tLx+tQwGrmQ+al0BJd5QYKBq5UPmotASTacWRbHAzrLlB2ft18N/9k='

"""Bad arguments of every command."""

from pathlib import Path

from support.bad import small
from support.bad.case import Bad, Kind, lines
from support.onnx_models import colour_network

COMMANDS = r"""
rnu baselines --logs logs --out out
run
run baselines
run baselines --logs logs
run baselines --out out
run baselines --lgos logs --out out
run baselinse --logs logs --out out
run nowhere.yaml --logs logs --out out
run logs --logs logs --out out
run baselines --logs nowhere --out out
run baselines --logs file.txt --out out
run baselines --logs empty --out out
run baselines --logs logs --out file.txt
run baselines --logs logs --out out --grids file.txt
run baselines --logs logs --out out --validation-logs nowhere
run baselines --logs logs --out out --trainings nowhere
run baselines --logs logs --out out --trainings file.txt
run baselines --logs logs --out out --row BL-DD --device cpu
run baselines --logs logs --out out --row 'ED-*' --device cpu
run baselines --logs logs --out out --device gpu
run baselines --logs logs --out out --device cuda:99
run baselines --logs logs --out out --jobs 0
run baselines --logs logs --out out --jobs two
run baselines --logs logs --out out --workers 257
run baselines --logs logs --out out --executor slurm
run baselines --logs logs --out out --own-models there
run baselines --logs logs --out out --time-limit 0
run baselines --logs logs --out out --time-limit -3
run baselines --logs logs --out out --memory-limit none
run baselines --logs logs --out out --memory-limit 0
run baselines --logs logs --out out --gpus -1
run baselines --logs logs --out out --dry-runn
run baselines more --logs logs --out out
convert waymo SRC out
convert cityscapse SRC out
convert cityscapes nowhere out
convert cityscapes empty
convert cityscapes file.txt out
convert cityscapes empty file.txt
convert cityscapes empty out --labels nowhere
convert cityscapes empty out --lables labels
convert cityscapes empty out --workers 0
convert synthetic
convert synthetic out --recordings 0
convert synthetic out --recordings many
convert synthetic out --recordings 2 --seed -1
convert synthetic out --recordings 2 --seed 18446744073709551616
convert synthetic out --recordings 2 --towns 0
convert synthetic out --recordings 2 --towns 1
convert synthetic out --recordings 2 --val-share 1.5
convert synthetic out --recordings 2 --frames 1
convert synthetic out --recordings 2 --frames 2000
convert synthetic out --recordings 2 --val-towns 4
convert synthetic out --recordings 2 --val-towns 0
convert synthetic out --recordings 2 --town-size-m 2000 --duration-s 3600
convert synthetic out --recordings 2 --town-size-m 10
convert synthetic out --recordings 2 --width 5
convert synthetic out --recordings 2 --height 5000
convert synthetic out --recordings 2 --stereo guessed
convert synthetic out --recordings 2 --duration-s 1
convert synthetic out --recordings 2 --errors none
convert synthetic out --recordings 2 --rig back
convert synthetic out --recordings 2 --split test
convert town-v1 out --size medium
convert town-v1 out --split test
convert town-v1 out --cache file.txt
convert town-rig-v1 out --rig front
check
check nowhere
check empty
check logs --spec nowhere.yaml
check logs --spec logs
check logs --recover file.txt
check logs --strcit
grids logs
grids nowhere grids
grids empty grids
grids file.txt grids
grids logs file.txt
grids logs out --config nowhere.yaml
grids logs out --config logs
grids logs out --workers none
segment logs --out out
segment logs --model nowhere.onnx --out out
segment logs --model logs --out out
segment logs --model net.onnx
segment nowhere --model net.onnx --out out
segment empty --model net.onnx --out out
segment logs --model net.onnx --out file.txt
segment logs --model net.onnx --out out --layout chw
segment logs --model net.onnx --out out --size 512
segment logs --model net.onnx --out out --mean 0 0 x
segment logs --model net.onnx --out out --upsample cubic
report
report run --resample towns
play
play run BL
play run BL --out logs
play run BL --out play.txt --recodring toy1
latency logs
latency nowhere --out latency.json
latency empty --out latency.json
latency logs --out logs
latency logs --out latency.json --model fues
latency logs --out latency.json --model ceiling
latency logs --out latency.json --model nowhere.py:Mine
latency logs --out latency.json --segment nowhere.onnx
latency logs --out latency.json --right nowhere --threads 1
latency logs --out latency.json --right empty --threads 1
latency logs --out latency.json --frames 0
latency logs --out latency.json --warm-up -1
latency logs --out latency.json --warm-up 1000 --threads 1 --device cpu
latency logs --out latency.json --threads 0
latency logs --out latency.json --processor-time
latency logs --out latency.json --device tpu
demo --recordings 3
demo --recordings 10001
demo --out file.txt
demo --seed -1
demo --device gpu
bench --only speed
bench --only render,traning
bench --device gpu
bench --json logs
bench --quikc
"""


def whole() -> None:
    """Write good logs with their grids, an empty folder, a file and a network."""
    small.whole()
    Path("empty").mkdir()
    Path("file.txt").write_text("text")
    colour_network(Path("net.onnx"), colours={0: (1.0, 0.0, 0.0)})


KIND = Kind(
    "Command lines",
    "Beside a folder of good logs `logs`, an empty folder `empty`, a file `file.txt` and a network `net.onnx`.",
    whole,
    tuple(Bad(line, line) for line in lines(COMMANDS)),
    shows_code=True,
)

"""The commands in docs/plc/quick-start.md, run as they stand there but for the port."""

import asyncio
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "plc" / "quick-start.md"
DEADLINE_S = 30.0


def documented():
    """Commands with the lines that must come back, in order."""
    steps = []
    for block in re.findall(r"```console\n(.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                steps.append((shlex.split(line[2:]), []))
            else:
                steps[-1][1].append(line)
    return steps


async def answer(command, port):
    where = [str(port) if before == "-p" else word for before, word in zip(["", *command], command, strict=False)]
    process = await asyncio.create_subprocess_exec(
        *where, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    out, _ = await asyncio.wait_for(process.communicate(), DEADLINE_S)
    return [line.rstrip() for line in out.decode().splitlines() if line.startswith(("[", "Written", "Read", "Write"))]


def test_every_command_answers_what_the_document_says(serve, mbpoll):
    steps = documented()
    assert {step[0][0] for step in steps} == {"mbpoll"}
    assert len(steps) >= 14

    async def main():
        async with serve() as rig:
            rig.first_sequence = 1
            for command, expected in steps:
                async with asyncio.timeout(DEADLINE_S):
                    while (got := await answer([mbpoll, *command[1:]], rig.port)) != expected:
                        polled = command[command.index("-r") + 1] in {"103", "106", "112", "128"}
                        assert polled, f"{shlex.join(command)}: {got}"
                        await asyncio.sleep(0.05)
            return rig.commands, rig.accepted, rig.state.queue

    assert asyncio.run(main()) == ([("change_recipe", 3)], [(7, 0, "")], ())


def test_the_python_in_the_document_inspects_a_fruit(serve, capsys):
    (source,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL)
    spaces: dict[str, Any] = {"__name__": "quick_start"}

    async def main():
        async with serve() as rig:
            exec(source.replace("5020", str(rig.port)).replace("asyncio.run(main())", ""), spaces)
            await spaces["main"]()

    asyncio.run(main())
    assert capsys.readouterr().out == "PASS 12.34 []\n"


@pytest.mark.parametrize("name", ["index.md", "integration.md", "quick-start.md", "in-sight.md"])
def test_every_register_and_bit_that_a_document_names_is_in_the_map(name, vocabulary):
    text = (DOCUMENT.parent / name).read_text("utf-8")
    plain = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    named = set(re.findall(r"`([a-z]+_[a-z_]+)`", plain))
    assert named
    assert named - vocabulary == set()


@pytest.mark.parametrize("refusal", ["busy", "recipe_changing"])
def test_a_refusal_is_waited_out_by_the_bit_that_ends_with_its_cause(refusal):
    """`inspecting` falls before the fruit is released, and no `command_done` follows a change from the panel."""
    text = (DOCUMENT.parent / "handshake.md").read_text("utf-8")
    (remedy,) = re.findall(rf"^\| {refusal} \| (.*) \|$", text, re.MULTILINE)
    assert remedy.startswith("wait for `trigger_ready`")

"""The command `visray completion`: scripts for shells. What they complete besides commands is in candidates.py."""

from typing import Annotated, Literal

from cyclopts import Parameter

from visray.cli.options import app
from visray.terminal import write

# What stands behind the script of a shell. In bash, a folder gets a slash, and no space follows it or an address, as a
# value does. In zsh, the script may be evaluated, and need not lie in a folder of functions.
MORE = {
    "bash": """
_visray_and_spaces() {
  local i
  _visray
  for i in "${!COMPREPLY[@]}"; do
    [[ -d "${COMPREPLY[i]}" ]] && COMPREPLY[i]+=/
  done
  [[ "${COMPREPLY[0]}" == *[=/] ]] && compopt -o nospace 2>/dev/null
  return 0
}

complete -F _visray_and_spaces visray
""",
    "zsh": "\ncompdef _cyclopts_visray visray\n",
}


@app.command(name="completion")
def completion_command(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="The shell.")],
    /,
) -> int:
    """Print what a shell needs to complete words at Tab.

    It completes commands, options, files, layers, and addresses of the scene behind --set. bash: put eval "$(visray
    completion bash)" into ~/.bashrc. zsh: the same with zsh, into ~/.zshrc, behind compinit. fish: visray
    completion fish > ~/.config/fish/completions/visray.fish
    """
    script = app.generate_completion(prog_name="visray", shell=shell)
    write(script + MORE.get(shell, ""))
    return 0

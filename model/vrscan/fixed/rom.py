"""SystemVerilog of tables in block RAM, written from the models that need them."""

from collections.abc import Mapping, Sequence

from vrscan.data.arrays import Ints


def rom_source(
    name: str,
    comment: Sequence[str],
    memories: Mapping[str, tuple[Ints, int]],
    ports: Mapping[str, str],
) -> str:
    """Return a module of tables, each read a clock after its index.

    Args:
        name: Name of the module.
        comment: Lines of its header, without the slashes; the first one says what it is.
        memories: Entries of each table, a power of two of them, and their bits.
        ports: Table that each read port reads; ``a`` has ``a_index_i`` and ``a_entry_o``.
    """

    def declared(word: str, width: int, port: str) -> str:
        return f"  {word} logic [{width - 1:2}:0] {port}"

    read = {port: memories[memory] for port, memory in ports.items()}
    lines = [
        declared("input  wire", (len(entries) - 1).bit_length(), f"{port}_index_i")
        for port, (entries, _) in read.items()
    ]
    results = [
        declared("output     ", width, f"{port}_entry_o") for port, (_, width) in read.items()
    ]
    body = [
        f"  always_ff @(posedge clk_i) {port}_entry_o <= {memory}[{port}_index_i];"
        for port, memory in ports.items()
    ]
    text = [
        f"// {name}: {comment[0]}",
        *(f"// {line}".rstrip() for line in ("", *comment[1:])),
        "//",
        "//   Latency  1 clock",
        "",
        "`default_nettype none",
        "",
        f"module {name} (",
        "  input  wire logic        clk_i,",
        "",
        *(f"{line}," for line in lines),
        "",
        *(f"{line}," for line in results[:-1]),
        results[-1],
        ");",
        "",
        *(f"  logic [{width - 1}:0] {memory}[{len(entries)}];"
          for memory, (entries, width) in memories.items()),
        "",
        *body,
        "",
        "  initial begin",
        *(f"    {memory}[{k}] = {width}'h{entry:0{-(-width // 4)}x};"
          for memory, (entries, width) in memories.items()
          for k, entry in enumerate(entries.tolist())),
        "  end",
        "",
        "endmodule",
        "",
        "`default_nettype wire",
        "",
    ]  # fmt: skip
    return "\n".join(text)

"""The registers as two structs, so that the top passes them on by name: a package and a wrapper."""

from dataclasses import dataclass

from registers import Map, Register, written_groups


@dataclass(frozen=True)
class Field:
    """A port of ``register_file`` that is a field of a struct."""

    name: str
    bits: int
    signed: bool = False
    written: bool = True  # by the bus

    @property
    def declaration(self) -> str:
        """The field in its struct. Numbers, as packages are read in the order of their paths."""
        words = ["logic", *(["signed"] if self.signed else [])]
        return " ".join([*words, *([f"[{self.bits - 1}:0]"] if self.bits > 1 else []), self.name])


def _of(register: Register) -> list[Field]:
    """Return the fields of one register."""
    if register.access == "constant":
        return []
    signed = register.signed and register.count == 1
    fields = [Field(register.name, register.width * register.count, signed, register.writable)]
    if register.access == "strobe":
        fields.append(Field(f"{register.name}_strobe", 1))
    return fields


def _fields(made: Map) -> list[Field]:
    """Return the fields of both structs in the order of the map."""
    fields = [field for register in made.registers for field in _of(register)]
    for window in made.windows:
        fields += [
            Field(f"{window.name}_write", 1),
            Field(f"{window.name}_index", window.index_bits),
        ]
        fields += [field for column in window.fields for field in _of(column)]
    return fields


def register_pkg(made: Map) -> str:
    """Return the package with the types of the two structs."""
    lines = [
        "// register_pkg: what the bus of the link writes, and what it reads, as one struct each.",
        "//",
        f"// Generated from {made.source} by scripts/generate.py; docs/registers.md says what the",
        "// fields are.",
        "",
        "`default_nettype none",
        "",
        "package register_pkg;",
    ]
    for kind, written in (("settings", True), ("status", False)):
        lines.append("  typedef struct packed {")
        lines += [
            f"    {field.declaration};" for field in _fields(made) if field.written == written
        ]
        lines += [f"  }} {kind}_t;", ""]
    lines[-1] = "endpackage"
    return "\n".join([*lines, "", "`default_nettype wire", ""])


def register_bank(made: Map) -> str:
    """Return the wrapper that has the structs for ports."""
    groups = len(written_groups(made))
    lines = [
        "// register_bank: register_file with a struct for each side.  Wiring only: register_file",
        "// has the twin and the test, and vrscan's tests go through this.  Each group of settings",
        "// has the register of its reset, a clock after rst_i.",
        "//",
        f"// Generated from {made.source} by scripts/generate.py.",
        "",
        "`default_nettype none",
        "",
        "module register_bank (",
        "  input  wire logic                              clk_i,",
        "  input  wire logic                              rst_i,",
        "",
        "  input  wire logic                              bus_valid_i,",
        "  input  wire logic [ link_pkg::AccessWidth-1:0] bus_access_i,",
        "  input  wire logic [link_pkg::AddressWidth-1:0] bus_address_i,",
        "  input  wire logic [                      31:0] bus_data_i,",
        "  output      logic                              bus_done_o,",
        "  output      logic [ link_pkg::StatusWidth-1:0] bus_status_o,",
        "  output      logic [                      31:0] bus_data_o,",
        "",
        "  output      register_pkg::settings_t           settings_o,",
        "  input  wire register_pkg::status_t             status_i",
        ");",
        "",
        "  logic rst;",
        f"  logic [{groups - 1}:0] group_rst;",
        "  local_register u_reset (.clk_i, .d_i(rst_i), .q_o(rst));",
        f"  for (genvar k = 0; k < {groups}; k++) begin : gen_reset",
        "    local_register u_reset (.clk_i, .d_i(rst_i), .q_o(group_rst[k]));",
        "  end",
        "",
        "  register_file u_register_file (",
        "    .clk_i, .rst_i(rst), .group_rst_i(group_rst),",
        "    .bus_valid_i, .bus_access_i, .bus_address_i, .bus_data_i,",
        "    .bus_done_o, .bus_status_o, .bus_data_o,",
    ]
    for field in _fields(made):
        struct, side = ("settings", "o") if field.written else ("status", "i")
        lines.append(f"    .{field.name}_{side}({struct}_{side}.{field.name}),")
    lines[-1] = lines[-1].removesuffix(",")
    return "\n".join([*lines, "  );", "", "endmodule", "", "`default_nettype wire", ""])

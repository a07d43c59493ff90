// The ports of the vendors' cells that rtl/boards instantiates, for the linters.

/* verilator lint_off DECLFILENAME */  // all of a few lines: one file
/* verilator lint_off UNUSEDSIGNAL */  // ports only: nothing is behind them
/* verilator lint_off UNUSEDPARAM */  // as above
/* verilator lint_off UNDRIVEN */  // as above
`default_nettype none

module EHXPLLL #(
  parameter int unsigned CLKI_DIV     = 1,
  parameter int unsigned CLKFB_DIV    = 1,
  parameter              CLKOP_ENABLE = "ENABLED",
  parameter int unsigned CLKOP_DIV    = 8,
  parameter int unsigned CLKOP_CPHASE = 0,
  parameter              CLKOS_ENABLE = "DISABLED",
  parameter int unsigned CLKOS_DIV    = 8,
  parameter int unsigned CLKOS_CPHASE = 0,
  parameter              FEEDBK_PATH  = "CLKOP"
) (
  input  wire logic CLKI, CLKFB, RST, STDBY, PHASESEL0, PHASESEL1, PHASEDIR, PHASESTEP,
  input  wire logic PHASELOADREG, PLLWAKESYNC, ENCLKOP,
  output      logic CLKOP, CLKOS, LOCK
);
endmodule

module OSCG #(
  parameter int unsigned DIV = 128
) (
  output      logic OSC
);
endmodule

module IDDRX1F (
  input  wire logic D, SCLK, RST,
  output      logic Q0, Q1
);
endmodule

module BB (
  inout  wire logic B,
  input  wire logic I, T,
  output      logic O
);
endmodule

module IOBUF (
  inout  wire logic IO,
  input  wire logic I, T,
  output      logic O
);
endmodule

module BUFG (
  input  wire logic I,
  output      logic O
);
endmodule

module STARTUPE2 (
  input  wire logic CLK, GSR, GTS, KEYCLEARB, PACK, USRCCLKO, USRCCLKTS, USRDONEO, USRDONETS,
  output      logic CFGMCLK
);
endmodule

module IDDR #(
  parameter DDR_CLK_EDGE = "OPPOSITE_EDGE"
) (
  input  wire logic D, C, CE, R, S,
  output      logic Q1, Q2
);
endmodule

`default_nettype wire

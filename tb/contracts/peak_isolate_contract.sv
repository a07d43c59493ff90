// peak_isolate_contract: the window that is measured lies inside the line, and is no wider than the
// elaboration allows.

`default_nettype none

module peak_isolate_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned MaxWindow  = 255,
  parameter int unsigned IndexWidth = 11,
  parameter int unsigned WidthWidth = 12
) (
  input wire logic                  clk_i,
  input wire logic                  rst_i,
  input wire logic                  valid_o,
  input wire logic                  measured_o,
  input wire logic [IndexWidth-1:0] left_o,
  input wire logic [IndexWidth-1:0] right_o,
  input wire logic [WidthWidth-1:0] width_o
);

  logic started_q;
  initial started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    if (started_q && valid_o && measured_o) begin
      simulated_window_inside_the_line:
      assert (left_o <= right_o && 32'(right_o) < LineLength);
      simulated_width_is_the_windows:
      assert (32'(width_o) == 32'(right_o) - 32'(left_o) + 32'd1 && 32'(width_o) <= MaxWindow);
    end
  end

endmodule

bind peak_isolate peak_isolate_contract #(
  .LineLength(LineLength), .MaxWindow(MaxWindow), .IndexWidth(IndexWidth), .WidthWidth(WidthWidth)
) u_contract (.*);

`default_nettype wire

// line_receiver_contract: a line that is declared good has all its pixels, its number, and whether
// one was dropped before it; counters of faults stop at their largest value.

`default_nettype none

module line_receiver_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned CountWidth = 16,
  parameter int unsigned IndexWidth = 11
) (
  input wire logic                                   clk_i,
  input wire logic                                   rst_i,
  input wire logic                                   line_start_i,
  input wire logic                                   line_end_i,
  input wire logic                                   pixel_valid_i,
  input wire logic [                 PixelWidth-1:0] pixel_i,
  input wire logic                                   valid_o,
  input wire logic [                 PixelWidth-1:0] pixel_o,
  input wire logic [                 IndexWidth-1:0] index_o,
  input wire logic                                   good_o,
  input wire logic [vrscan_pkg::LineNumberWidth-1:0] line_number_o,
  input wire logic                                   lost_o,
  input wire logic [   vrscan_pkg::CounterWidth-1:0] short_count_o,
  input wire logic [   vrscan_pkg::CounterWidth-1:0] long_count_o,
  input wire logic [   vrscan_pkg::CounterWidth-1:0] unfinished_count_o,
  input wire logic [   vrscan_pkg::CounterWidth-1:0] early_count_o
);

  localparam logic [31:0] Most = 32'((64'd1 << CountWidth) - 64'd1);

  logic                  started_q, open_q, take_q, ended_q, unfinished_q, dropped_q, reset_q;
  logic [          31:0] next_q;  // index of the line's next pixel
  logic [          31:0] pixels_q;  // of the line, a clock ago
  logic [          31:0] starts_q, faults_q, faults;
  logic [PixelWidth-1:0] pixel_q;
  initial started_q = 1'b0;

  // What comes.
  logic        open;
  logic [31:0] prior, pixels;
  assign open   = open_q || line_start_i;
  assign prior  = line_start_i ? '0 : next_q;
  assign pixels = open && pixel_valid_i && prior <= LineLength ? prior + 32'd1 : prior;
  assign faults = 32'(short_count_o) + 32'(long_count_o) + 32'(unfinished_count_o)
                  + 32'(early_count_o);

  always_ff @(posedge clk_i) begin
    started_q    <= started_q || rst_i;
    reset_q      <= rst_i;
    open_q       <= open && !line_end_i && !rst_i;
    next_q       <= pixels;
    pixels_q     <= pixels;
    take_q       <= open && pixel_valid_i && prior < LineLength && !rst_i;
    ended_q      <= open && line_end_i && !rst_i;
    unfinished_q <= open_q && line_start_i && !rst_i;
    starts_q     <= rst_i ? '0 : starts_q + 32'(line_start_i);
    dropped_q    <= !rst_i && !good_o && (dropped_q || unfinished_q || ended_q);
    pixel_q      <= pixel_i;
    faults_q     <= faults;

    if (started_q) begin
      simulated_pixels_in_order: assert (valid_o == take_q);
      simulated_pixel:
      assert (!valid_o || (pixel_o == pixel_q && 32'(index_o) == pixels_q - 32'd1));
      simulated_complete: assert (!good_o || (ended_q && pixels_q == LineLength));
      simulated_numbered: assert (!good_o || line_number_o == starts_q - 32'd1);
      simulated_lost_is_told: assert (!good_o || lost_o == (dropped_q || unfinished_q));
      simulated_counters_stop: assert (
          32'(short_count_o) <= Most && 32'(long_count_o) <= Most &&
          32'(unfinished_count_o) <= Most && 32'(early_count_o) <= Most);
      simulated_counters_stay: assert (reset_q || faults >= faults_q);
    end
  end

endmodule

bind line_receiver line_receiver_contract #(
  .LineLength(LineLength), .PixelWidth(PixelWidth), .CountWidth(CountWidth), .IndexWidth(IndexWidth)
) u_contract (.*);

`default_nettype wire

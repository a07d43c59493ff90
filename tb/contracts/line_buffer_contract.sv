// line_buffer_contract: what line_buffer promises.
//
// place_q is a place of the line that only a reset changes: any one in a proof, another one in each
// simulation.  Its pixel is kept here a second time.

`default_nettype none

module line_buffer_contract #(
  parameter int unsigned LineLength = 2048,
  parameter int unsigned PixelWidth = 12,
  parameter int unsigned IndexWidth = 11
) (
  input wire logic                  clk_i,
  input wire logic                  rst_i,
  input wire logic                  valid_i,
  input wire logic [PixelWidth-1:0] pixel_i,
  input wire logic [IndexWidth-1:0] index_i,
  input wire logic                  good_i,
  input wire logic                  replay_i,
  input wire logic                  valid_o,
  input wire logic [PixelWidth-1:0] pixel_o,
  input wire logic [IndexWidth-1:0] index_o,
  input wire logic                  last_o,
  input wire logic                  write_bank_q,
  input wire logic                  read_bank_q,
  input wire logic                  reading_q,
  input wire logic [IndexWidth-1:0] read_index_q,
  input wire logic                  valid_q,
  input wire logic [IndexWidth-1:0] index_q
);

  localparam logic [IndexWidth-1:0] Last = IndexWidth'(LineLength - 1);

  logic started_q;
  initial started_q = 1'b0;

  logic [IndexWidth-1:0] place_q, picked;
  assign picked = place_q <= Last ? place_q : '0;

  // ---- the pixel at that place, of the line that comes, of the good one, of the one replayed ----
  logic                  coming_known_q, good_known_q, coming_known;
  logic [PixelWidth-1:0] coming_q, good_q, coming;
  logic [           2:0] known_q;
  logic [PixelWidth-1:0] replayed_q, replayed_q2, replayed_q3;
  assign coming_known = coming_known_q || (valid_i && index_i == picked);
  assign coming       = valid_i && index_i == picked ? pixel_i : coming_q;

  // ---- where the replay is: place and age ----
  logic [IndexWidth-1:0] at_q;
  logic [           2:0] begun_q;  // replay_i of the last three clocks
  logic                  gives_q;

  always_ff @(posedge clk_i) begin
    started_q <= started_q || rst_i;
    if (rst_i) place_q <= place_q ^ index_i;
    begun_q   <= {begun_q[1:0], replay_i};
    gives_q   <= begun_q[1] || (gives_q && at_q != Last);
    at_q      <= begun_q[1] ? '0 : at_q + IndexWidth'(1);
    if (valid_i && index_i == picked) {coming_known_q, coming_q} <= {1'b1, pixel_i};
    if (good_i) begin
      coming_known_q <= 1'b0;
      {good_known_q, good_q} <= {coming_known, coming};
    end
    // What is read is given two clocks later.
    known_q     <= {known_q[1:0], replay_i ? good_known_q : known_q[0]};
    replayed_q  <= replay_i ? good_q : replayed_q;
    replayed_q2 <= replayed_q;
    replayed_q3 <= replayed_q2;
    if (rst_i) begin
      {coming_known_q, good_known_q, known_q} <= '0;
      begun_q <= '0;
      gives_q <= 1'b0;
    end

    if (started_q) begin
      // Where the bank that is replayed is written again, it is behind the replay.
      replayed_in_time: assume (!valid_i || !reading_q || write_bank_q != read_bank_q ||
                                index_i <= read_index_q);
      in_range: assume (!valid_i || index_i <= Last);

      inside_the_line: assert (!valid_o || index_o <= Last);
      a_line_without_a_gap: assert (valid_o == gives_q && (!valid_o || index_o == at_q));
      last_is_the_last: assert (!valid_o || last_o == (index_o == Last));
      bounded_the_good_line_is_replayed:
      assert (!valid_o || index_o != picked || !known_q[2] || pixel_o == replayed_q3);

      step_reading: assert (begun_q[0] ? reading_q && read_index_q == '0
                                       : !reading_q || read_index_q <= Last);
      step_valid: assert (valid_q == (begun_q[1] || (gives_q && at_q != Last)));
      step_index: assert (!valid_q || (index_q <= Last &&
                                       index_q == (begun_q[1] ? '0 : at_q + IndexWidth'(1))));
      step_next: assert (begun_q[0] || reading_q == (valid_q && index_q != Last));
      step_read: assert (begun_q[0] || !reading_q || read_index_q == index_q + IndexWidth'(1));

      a_line: cover (valid_o && last_o && known_q[2] && picked == Last && replayed_q3 == '1);
    end
  end

endmodule

bind line_buffer line_buffer_contract #(
  .LineLength(LineLength), .PixelWidth(PixelWidth), .IndexWidth(IndexWidth)
) u_contract (.*);

`default_nettype wire

// frame_pkg: what both ends of a frame agree on: its CRC, and how a received one has ended.
//
// The CRC has 16 bits, polynomial 0x1021, begins with ones, is neither reflected nor inverted, and
// is sent high byte first: run over payload and CRC, it ends at zero.  The other home of these
// facts is vrscan.clocked.frame_encoder and frame_decoder.

`default_nettype none

package frame_pkg;
  localparam int unsigned CrcWidth = 16;
  localparam logic [CrcWidth-1:0] CrcInit = 16'hffff;

  localparam int unsigned StatusWidth = 3;
  localparam logic [StatusWidth-1:0] StatusOk = 3'd0;
  localparam logic [StatusWidth-1:0] StatusCrc = 3'd1;
  localparam logic [StatusWidth-1:0] StatusMalformed = 3'd2;  // ended within a block
  localparam logic [StatusWidth-1:0] StatusTooLong = 3'd3;
  localparam logic [StatusWidth-1:0] StatusTooShort = 3'd4;  // no room for a payload and a CRC
  localparam logic [StatusWidth-1:0] StatusFraming = 3'd5;  // a byte without its stop bit

  // Eight steps of the polynomial at once: a byte meets its own feedback only four bits further on.
  function automatic logic [CrcWidth-1:0] crc_next(input logic [CrcWidth-1:0] crc,
                                                   input logic [7:0] data);
    logic [7:0] mixed;
    mixed = crc[15:8] ^ data;
    mixed = mixed ^ {4'd0, mixed[7:4]};
    crc_next = {crc[7:0], 8'd0} ^ {mixed[3:0], 12'd0} ^ {3'd0, mixed, 5'd0} ^ {8'd0, mixed};
  endfunction
endpackage

`default_nettype wire

// cordic_pkg: the angles of a CORDIC's rotations.
//
// Generated from vrscan.fixed.cordic_vector.arc_tangents() by scripts/generate.py.

`default_nettype none

package cordic_pkg;
  localparam int unsigned TableWidth = 40;  // one turn is 2**TableWidth

  // atan(2**-index), cut.
  function automatic logic [39:0] arc_tangent(input logic [4:0] index);
    case (index)
      5'd0: arc_tangent = 40'h2000000000;
      5'd1: arc_tangent = 40'h12e4051d9d;
      5'd2: arc_tangent = 40'h09fb385b5e;
      5'd3: arc_tangent = 40'h051111d41d;
      5'd4: arc_tangent = 40'h028b0d430e;
      5'd5: arc_tangent = 40'h0145d7e159;
      5'd6: arc_tangent = 40'h00a2f61e5c;
      5'd7: arc_tangent = 40'h00517c5511;
      5'd8: arc_tangent = 40'h0028be5346;
      5'd9: arc_tangent = 40'h00145f2ebb;
      5'd10: arc_tangent = 40'h000a2f9800;
      5'd11: arc_tangent = 40'h000517cc14;
      5'd12: arc_tangent = 40'h00028be60c;
      5'd13: arc_tangent = 40'h000145f306;
      5'd14: arc_tangent = 40'h0000a2f983;
      5'd15: arc_tangent = 40'h0000517cc1;
      5'd16: arc_tangent = 40'h000028be60;
      5'd17: arc_tangent = 40'h0000145f30;
      5'd18: arc_tangent = 40'h00000a2f98;
      5'd19: arc_tangent = 40'h00000517cc;
      5'd20: arc_tangent = 40'h0000028be6;
      5'd21: arc_tangent = 40'h00000145f3;
      5'd22: arc_tangent = 40'h000000a2f9;
      5'd23: arc_tangent = 40'h000000517c;
      5'd24: arc_tangent = 40'h00000028be;
      5'd25: arc_tangent = 40'h000000145f;
      5'd26: arc_tangent = 40'h0000000a2f;
      5'd27: arc_tangent = 40'h0000000517;
      5'd28: arc_tangent = 40'h000000028b;
      5'd29: arc_tangent = 40'h0000000145;
      5'd30: arc_tangent = 40'h00000000a2;
      default: arc_tangent = 40'h0000000051;
    endcase
  endfunction
endpackage

`default_nettype wire

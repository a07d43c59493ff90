// spot_sigma_pkg: sigma of a spot over the length of its window, by |P1| over the sum.
//
// Generated from vrscan.fixed.peak_refine.sigma_table() by scripts/generate.py.

`default_nettype none

package spot_sigma_pkg;
  localparam int unsigned SigmaFraction = 9;
  localparam logic [8:0] Largest = 9'd256;  // a plateau

  function automatic logic [8:0] sigma(
      input logic [6:0] share);
    unique case (share)
      7'd0: sigma = 9'd256;
      7'd1: sigma = 9'd256;
      7'd2: sigma = 9'd256;
      7'd3: sigma = 9'd256;
      7'd4: sigma = 9'd256;
      7'd5: sigma = 9'd256;
      7'd6: sigma = 9'd256;
      7'd7: sigma = 9'd256;
      7'd8: sigma = 9'd256;
      7'd9: sigma = 9'd256;
      7'd10: sigma = 9'd254;
      7'd11: sigma = 9'd242;
      7'd12: sigma = 9'd232;
      7'd13: sigma = 9'd222;
      7'd14: sigma = 9'd214;
      7'd15: sigma = 9'd207;
      7'd16: sigma = 9'd200;
      7'd17: sigma = 9'd194;
      7'd18: sigma = 9'd188;
      7'd19: sigma = 9'd183;
      7'd20: sigma = 9'd178;
      7'd21: sigma = 9'd173;
      7'd22: sigma = 9'd169;
      7'd23: sigma = 9'd165;
      7'd24: sigma = 9'd161;
      7'd25: sigma = 9'd157;
      7'd26: sigma = 9'd154;
      7'd27: sigma = 9'd150;
      7'd28: sigma = 9'd147;
      7'd29: sigma = 9'd144;
      7'd30: sigma = 9'd142;
      7'd31: sigma = 9'd139;
      7'd32: sigma = 9'd136;
      7'd33: sigma = 9'd134;
      7'd34: sigma = 9'd131;
      7'd35: sigma = 9'd129;
      7'd36: sigma = 9'd127;
      7'd37: sigma = 9'd124;
      7'd38: sigma = 9'd122;
      7'd39: sigma = 9'd120;
      7'd40: sigma = 9'd118;
      7'd41: sigma = 9'd116;
      7'd42: sigma = 9'd115;
      7'd43: sigma = 9'd113;
      7'd44: sigma = 9'd111;
      7'd45: sigma = 9'd109;
      7'd46: sigma = 9'd107;
      7'd47: sigma = 9'd106;
      7'd48: sigma = 9'd104;
      7'd49: sigma = 9'd103;
      7'd50: sigma = 9'd101;
      7'd51: sigma = 9'd99;
      7'd52: sigma = 9'd98;
      7'd53: sigma = 9'd96;
      7'd54: sigma = 9'd95;
      7'd55: sigma = 9'd93;
      7'd56: sigma = 9'd92;
      7'd57: sigma = 9'd91;
      7'd58: sigma = 9'd89;
      7'd59: sigma = 9'd88;
      7'd60: sigma = 9'd86;
      7'd61: sigma = 9'd85;
      7'd62: sigma = 9'd84;
      7'd63: sigma = 9'd82;
      7'd64: sigma = 9'd81;
      7'd65: sigma = 9'd80;
      7'd66: sigma = 9'd78;
      7'd67: sigma = 9'd77;
      7'd68: sigma = 9'd76;
      7'd69: sigma = 9'd74;
      7'd70: sigma = 9'd73;
      7'd71: sigma = 9'd72;
      7'd72: sigma = 9'd71;
      7'd73: sigma = 9'd69;
      7'd74: sigma = 9'd68;
      7'd75: sigma = 9'd67;
      7'd76: sigma = 9'd65;
      7'd77: sigma = 9'd64;
      7'd78: sigma = 9'd63;
      7'd79: sigma = 9'd61;
      7'd80: sigma = 9'd60;
      7'd81: sigma = 9'd58;
      7'd82: sigma = 9'd57;
      7'd83: sigma = 9'd56;
      7'd84: sigma = 9'd54;
      7'd85: sigma = 9'd53;
      7'd86: sigma = 9'd51;
      7'd87: sigma = 9'd51;
      7'd88: sigma = 9'd51;
      7'd89: sigma = 9'd51;
      7'd90: sigma = 9'd51;
      7'd91: sigma = 9'd51;
      7'd92: sigma = 9'd51;
      7'd93: sigma = 9'd51;
      7'd94: sigma = 9'd51;
      7'd95: sigma = 9'd51;
      7'd96: sigma = 9'd51;
      7'd97: sigma = 9'd51;
      7'd98: sigma = 9'd51;
      7'd99: sigma = 9'd51;
      7'd100: sigma = 9'd51;
      7'd101: sigma = 9'd51;
      7'd102: sigma = 9'd51;
      7'd103: sigma = 9'd51;
      7'd104: sigma = 9'd51;
      7'd105: sigma = 9'd51;
      7'd106: sigma = 9'd51;
      7'd107: sigma = 9'd51;
      7'd108: sigma = 9'd51;
      7'd109: sigma = 9'd51;
      7'd110: sigma = 9'd51;
      7'd111: sigma = 9'd51;
      7'd112: sigma = 9'd51;
      7'd113: sigma = 9'd51;
      7'd114: sigma = 9'd51;
      7'd115: sigma = 9'd51;
      7'd116: sigma = 9'd51;
      7'd117: sigma = 9'd51;
      7'd118: sigma = 9'd51;
      7'd119: sigma = 9'd51;
      7'd120: sigma = 9'd51;
      7'd121: sigma = 9'd51;
      7'd122: sigma = 9'd51;
      7'd123: sigma = 9'd51;
      7'd124: sigma = 9'd51;
      7'd125: sigma = 9'd51;
      7'd126: sigma = 9'd51;
      7'd127: sigma = 9'd51;
      default: sigma = 9'd51;
    endcase
  endfunction
endpackage

`default_nettype wire

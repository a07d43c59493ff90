# Arty A7-35; the pins are those of Digilent/digilent-xdc, Arty-A7-35-Master.xdc.
set_property -dict {PACKAGE_PIN E3 IOSTANDARD LVCMOS33} [get_ports {clk_100mhz_i}]
create_clock -name clk -period 10.000 [get_ports clk_100mhz_i]

# BTN0, LD4 .. LD7, USB serial
set_property -dict {PACKAGE_PIN D9 IOSTANDARD LVCMOS33} [get_ports {button_i}]
set_property -dict {PACKAGE_PIN H5 IOSTANDARD LVCMOS33} [get_ports {led_o[0]}]
set_property -dict {PACKAGE_PIN J5 IOSTANDARD LVCMOS33} [get_ports {led_o[1]}]
set_property -dict {PACKAGE_PIN T9 IOSTANDARD LVCMOS33} [get_ports {led_o[2]}]
set_property -dict {PACKAGE_PIN T10 IOSTANDARD LVCMOS33} [get_ports {led_o[3]}]
set_property -dict {PACKAGE_PIN A9 IOSTANDARD LVCMOS33} [get_ports {uart_rx_i}]
set_property -dict {PACKAGE_PIN D10 IOSTANDARD LVCMOS33} [get_ports {uart_tx_o}]

# JB and JC, the sensor: clock, line valid, start and exposure, then the pixel, bit 0 first.  JB1 reaches a clock net.
set_property -dict {PACKAGE_PIN E15 IOSTANDARD LVCMOS33} [get_ports {sensor_clk_i}]
set_property -dict {PACKAGE_PIN E16 IOSTANDARD LVCMOS33} [get_ports {sensor_valid_i}]
set_property -dict {PACKAGE_PIN D15 IOSTANDARD LVCMOS33} [get_ports {sensor_start_o}]
set_property -dict {PACKAGE_PIN C15 IOSTANDARD LVCMOS33} [get_ports {sensor_exposure_o}]
create_clock -name sensor -period 12.500 [get_ports sensor_clk_i]
# Valid and pixel change -0.1 to 2.5 ns after the clock's fall, whose halves are even within 0.5 ns (as "PCLK to output
# valid" of the Honeywell IS4911's manual).
set_input_delay -clock sensor -clock_fall -max 3.0 [get_ports {sensor_valid_i sensor_pixel_i[*]}]
set_input_delay -clock sensor -clock_fall -min -0.6 [get_ports {sensor_valid_i sensor_pixel_i[*]}]
set_property -dict {PACKAGE_PIN J17 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[0]}]
set_property -dict {PACKAGE_PIN J18 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[1]}]
set_property -dict {PACKAGE_PIN K15 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[2]}]
set_property -dict {PACKAGE_PIN J15 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[3]}]
set_property -dict {PACKAGE_PIN U12 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[4]}]
set_property -dict {PACKAGE_PIN V12 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[5]}]
set_property -dict {PACKAGE_PIN V10 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[6]}]
set_property -dict {PACKAGE_PIN V11 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[7]}]
set_property -dict {PACKAGE_PIN U14 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[8]}]
set_property -dict {PACKAGE_PIN V14 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[9]}]
set_property -dict {PACKAGE_PIN T13 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[10]}]
set_property -dict {PACKAGE_PIN U13 IOSTANDARD LVCMOS33} [get_ports {sensor_pixel_i[11]}]

# JA: the mirror, then the lens
set_property -dict {PACKAGE_PIN G13 IOSTANDARD LVCMOS33} [get_ports {comparator_i}]
set_property -dict {PACKAGE_PIN B11 IOSTANDARD LVCMOS33} [get_ports {gate_i}]
set_property -dict {PACKAGE_PIN A11 IOSTANDARD LVCMOS33} [get_ports {drive_o}]
set_property -dict {PACKAGE_PIN D12 IOSTANDARD LVCMOS33} [get_ports {level_o}]
set_property -dict {PACKAGE_PIN D13 IOSTANDARD LVCMOS33 PULLUP true} [get_ports {focus_scl_io}]
set_property -dict {PACKAGE_PIN B18 IOSTANDARD LVCMOS33 PULLUP true} [get_ports {focus_sda_io}]

# JD: the laser.  A pin that is not driven must be dark: the driver pulls it down.
set_property -dict {PACKAGE_PIN D4 IOSTANDARD LVCMOS33 PULLDOWN true} [get_ports {pulse_o}]
set_property -dict {PACKAGE_PIN D3 IOSTANDARD LVCMOS33 PULLDOWN true} [get_ports {power_o}]
set_property -dict {PACKAGE_PIN F4 IOSTANDARD LVCMOS33 PULLDOWN true} [get_ports {index_light_o}]
set_property -dict {PACKAGE_PIN F3 IOSTANDARD LVCMOS33 PULLDOWN true} [get_ports {startup_o}]

# What crosses between clocks does so through synchronisers.  CFGMCLK, 65 MHz within a half.
create_clock -name guard -period 10.000 [get_pins u_startup/CFGMCLK]
set_clock_groups -asynchronous -group {clk sensor} -group guard
# Gray code: its bits arrive within a period of the faster clock of each other.
set_max_delay -datapath_only -from [get_clocks sensor] -to [get_clocks clk] 10.000
set_max_delay -datapath_only -from [get_clocks clk] -to [get_clocks sensor] 10.000
set_bus_skew -from [get_clocks sensor] -to [get_cells u_pixel_fifo/u_from_pixel/meta_q_reg[*]] 10.000
set_bus_skew -from [get_clocks clk] -to [get_cells u_pixel_fifo/u_to_pixel/meta_q_reg[*]] 10.000

set_property CFGBVS VCCO [current_design]
set_property CONFIG_VOLTAGE 3.3 [current_design]

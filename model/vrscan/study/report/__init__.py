"""Reports: tables, pictures and the measurements behind them."""

// What the page's scripts find without an import.
declare const uPlot: any;
